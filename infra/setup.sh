#!/usr/bin/env bash
# Set up aug3d in a virtual environment: Python 3.11, pinned packages, and the system libraries that their wheels leave out.
set -euo pipefail
venv=${1:-.venv}
say() { printf '\033[1maug3d setup:\033[0m %s\n' "$*"; }

# bpy has wheels for CPython 3.11 only. Where the machine has none, uv (from PyPI) fetches one.
find_python() {
  for candidate in python3.11 python3 python; do
    if "$candidate" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null; then
      command -v "$candidate"
      return 0
    fi
  done
  return 1
}

make_venv() {
  if "$venv/bin/python" -c 'import sys, pip; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null; then
    return 0
  fi
  if python=$(find_python); then
    say "virtual environment in $venv with $($python --version)"
    "$python" -m venv --clear "$venv"
    return
  fi
  say "this machine has no Python 3.11 with venv ($(python3 --version 2>/dev/null || echo 'no python3')); fetching one with uv"
  tools=$(mktemp -d)
  trap 'rm -rf "$tools"' EXIT
  if ! python3 -m pip install --quiet --target "$tools" uv 2>/dev/null; then
    say "uv could not be installed. Install Python 3.11 and run make again; on Debian 12: apt-get install -y python3.11-venv"
    exit 1
  fi
  "$tools/bin/uv" venv --clear --seed --python 3.11 "$venv"
}

# Wheels bring almost everything; these shared libraries must come from the system.
install_system_libraries() {
  local missing=()
  local known
  known=$(PATH=$PATH:/sbin:/usr/sbin ldconfig -p)
  while read -r library package; do
    grep -qF "$library" <<<"$known" || missing+=("$package")
  done <aug3d_core/system_libraries.txt
  [ ${#missing[@]} -eq 0 ] && return 0
  local install="apt-get update && apt-get install -y ${missing[*]}"
  if command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
    say "installing system libraries: ${missing[*]}"
    apt-get update -qq >/dev/null && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "${missing[@]}" >/dev/null
  elif command -v apt-get >/dev/null && sudo -n true 2>/dev/null; then
    say "installing system libraries: ${missing[*]}"
    sudo apt-get update -qq >/dev/null && sudo DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "${missing[@]}" >/dev/null
  else
    say "system libraries are missing. Type this one line, then run make again:"
    printf '\n    sudo sh -c "%s"\n\n' "$install"
    exit 1
  fi
}

install_system_libraries
make_venv
say "installing pinned packages (3.5 GB on disk; some minutes)"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
say "ready"
