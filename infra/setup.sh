#!/usr/bin/env bash
# Set up aug3d in a virtual environment: Python 3.11, pinned packages, and the system libraries that their wheels leave out.
set -euo pipefail
venv=${1:-.venv}
installing=$venv/.installing  # while this is there, packages may be half written: pip cannot go on from that
say() { printf '\033[1maug3d setup:\033[0m %s\n' "$*"; }

# Install Debian packages where we may; else print the one line to type.
apt_install() {
  local install="apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq $*"
  if ! command -v apt-get >/dev/null; then
    say "this system has no apt-get; install what Debian calls: $*"
    exit 1
  elif [ "$(id -u)" = 0 ]; then
    say "installing $*"
    sh -c "$install" >/dev/null
  elif sudo -n true 2>/dev/null; then
    say "installing $*"
    sudo sh -c "$install" >/dev/null
  else
    say "$* missing. Type this one line, then run make again:"
    printf '\n    sudo sh -c "%s"\n\n' "$install"
    exit 1
  fi
}

# Wheels bring almost everything; these shared libraries must come from the system.
install_system_libraries() {
  local missing=() known
  known=$(PATH=$PATH:/sbin:/usr/sbin ldconfig -p)
  while read -r library package; do
    grep -qF "$library" <<<"$known" || missing+=("$package")
  done <aug3d_core/system_libraries.txt
  [ ${#missing[@]} -eq 0 ] || apt_install "${missing[@]}"
}

is_311() { "$1" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null; }

# bpy has wheels for CPython 3.11 only. Where the machine has none, uv (from PyPI) fetches one.
make_venv() {
  if [ ! -e "$installing" ] && is_311 "$venv/bin/python" && "$venv/bin/python" -c 'import pip' 2>/dev/null; then
    return 0
  fi
  for candidate in python3.11 python3 python; do
    is_311 "$candidate" || continue
    # Debian keeps venv in a package of its own.
    "$candidate" -c 'import venv, ensurepip' 2>/dev/null || apt_install python3.11-venv
    say "virtual environment in $venv with $("$candidate" --version)"
    "$candidate" -m venv --clear "$venv"
    return 0
  done
  say "this machine has no Python 3.11 ($(python3 --version 2>/dev/null || echo 'no python3')); fetching one with uv"
  python3 -m pip --version >/dev/null 2>&1 || apt_install python3-pip
  tools=$(mktemp -d)
  trap 'rm -rf "$tools"' EXIT
  python3 -m pip install --quiet --disable-pip-version-check --target "$tools" uv
  "$tools/bin/uv" venv --clear --seed --python 3.11 "$venv"
}

install_system_libraries
make_venv
say "installing pinned packages (3.5 GB on disk; some minutes)"
touch "$installing"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
rm "$installing"
say "ready"
