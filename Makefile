# The two commands of the README: make demo, make test. Both first install what is missing.
SHELL := /bin/bash
VENV := .venv
PY := $(VENV)/bin/python
READY := $(VENV)/.ready
# Two processes more than cores (tests/processes.py): tests wait for servers and leases meanwhile
SHARED := -n auto --maxprocesses 4
# Tests start hundreds of processes: else each would compile all that it imports of aug3d again
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test check attack setup clean

demo: $(READY)  ## the whole factory on the built-in town
	@$(VENV)/bin/aug3d demo

test: $(READY)  ## the whole test suite, with the real engines
	@$(PY) -m pytest $(SHARED)

check: $(READY)  ## lint, types and the quick tests, for daily work
	@$(VENV)/bin/ruff check . && $(VENV)/bin/ruff format --check . && $(VENV)/bin/pyright && $(PY) -m pytest -m "not slow" -q $(SHARED)

attack: $(READY)  ## kills, full disks, flipped bits, malformed input: what is in tests/attack, also what takes long
	@$(PY) -m pytest tests/attack -m attack $(SHARED)

setup: $(READY)  ## install only

$(READY): pyproject.toml constraints.txt infra/setup.sh
	@infra/setup.sh $(VENV)
	@touch $(READY)

clean:  ## delete the environment; the home folder stays (aug3d gc cleans it up)
	rm -rf $(VENV)
