# make help names the targets. They run setup themselves; it is quick when nothing has changed.
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
BROWSER := $(VENV)/.browser

# The environment in .venv is complete; a ROS 2 sourced in this shell must not mix with it, and the start-up guard of the
# wheels must not be inherited from another environment.
unexport PYTHONPATH PYTHONHOME LD_LIBRARY_PATH AMENT_PREFIX_PATH RMW_IMPLEMENTATION _ROS_WHEELS_BOOTSTRAP_COMPLETE
# Each of the many processes would read all sources again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup check demo test test-live test-browser docs-check soak bench published docs site clean

help:
	@echo "make setup   create .venv with everything (no root needed)"
	@echo "make demo    peg into hole through three live nodes; options: make demo ARGS='--seconds 20'"
	@echo "make check   lint, types, import contracts, and all tests that need no live node"
	@echo "make test    make check, and what each node has to do: start, exchange, record, stop; no time is judged"
	@echo "make test-live      all other tests of live nodes; those that judge time only where haptic doctor finds no fault"
	@echo "make docs-check     documents, pictures and published results against the code; the tutorials, block by block"
	@echo "make soak    what takes long or breaks things on purpose: CONTRIBUTING.md lists it"
	@echo "make bench   measurements in their short form, and the table of docs/benchmarks/performance.md made of them"
	@echo "make published   results of others beside ours; fails if one is out of its tolerance"
	@echo "make docs    write docs/reference/parameters.md and docs/reference/faults.md from the code"
	@echo "make site    these documents as a site in site/; open site/index.html"
	@echo "make test-browser   the page and the site in a real Chromium; as root it installs one if there is none"
	@echo "make clean   remove .venv and everything built"

setup: $(READY)
	$(if $(filter setup,$(MAKECMDGOALS)),@echo "next: . .venv/bin/activate; haptic demo --view")

$(READY): setup.py setup.cfg constraints.txt
	@if ! $(BIN)/python -c 'import pip' 2>/dev/null; then \
	  python=; \
	  for candidate in "$${PYTHON:-}" python3.12 python3.11 python3.13 python3; do \
	    if [ -n "$$candidate" ] && "$$candidate" -c 'import sys, venv, ensurepip; assert (3, 11) <= sys.version_info < (3, 14)' \
	      >/dev/null 2>&1; then python=$$candidate; break; fi; \
	  done; \
	  if [ -z "$$python" ]; then \
	    echo "setup: no Python 3.11, 3.12 or 3.13 with venv found; install one (Debian, Ubuntu: python3-venv) or run make PYTHON=/path/to/python3" >&2; \
	    exit 1; \
	  fi; \
	  echo "setup: creating $(VENV) with $$("$$python" -V)"; \
	  "$$python" -m venv --clear $(VENV); \
	fi
	@echo "setup: installing packages into $(VENV) (some minutes the first time)"
	@for second in $$(seq 10 10 3600); do sleep 10 &>/dev/null; echo "setup: $$second s, $$(tail -n 1 $(VENV)/setup.log | cut -c 1-90)"; done & \
	said=$$!; trap 'kill $$said' EXIT; \
	if ! $(BIN)/python -m pip install --disable-pip-version-check -c constraints.txt -e '.[ros,test,bench]' >$(VENV)/setup.log 2>&1; then \
	  grep -E '^ *(ERROR|error):' $(VENV)/setup.log >&2 || tail -n 5 $(VENV)/setup.log >&2; \
	  echo "setup: pip could not install the packages above; the first setup needs the Python Package Index or a mirror (PIP_INDEX_URL), later runs need no network; the whole log is $(VENV)/setup.log" >&2; \
	  exit 1; \
	fi
	@$(BIN)/haptic compile || echo "setup: what is not compiled now is compiled when it is first needed" >&2
	@touch $@
	@echo "setup: ready"

demo: setup
	@$(BIN)/haptic demo $(ARGS)

check: setup
	@$(BIN)/haptic compile  # what was edited since
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache
	$(BIN)/python -m pytest test/unit -n 2 --dist worksteal

test: check
	$(BIN)/python -m pytest test/live/smoke

test-live: setup
	@$(BIN)/haptic compile  # what was edited since
	$(BIN)/python -m pytest test/live --ignore test/live/smoke

docs-check: setup
	@$(BIN)/haptic compile  # what was edited since
	$(BIN)/python -m pytest test/docs

soak: setup
	$(BIN)/python -m pytest test/soak test/adversary test/fault_injection
	$(BIN)/python -m pytest --hypothesis-profile=search --timeout=0 $$(grep -l "from examples import" test/unit/test_*.py)

bench: setup
	$(BIN)/python -m bench all --short --out bench_results/$(shell date +%F_%H%M) --insert docs/benchmarks/performance.md

published: setup
	$(BIN)/python -m bench published

test-browser: setup $(BROWSER)
	$(BIN)/python test/browser/chromium.py
	$(BIN)/python -m pytest test/browser

$(BROWSER): $(READY)
	@$(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.[browser]'
	@touch $@

docs: setup
	$(BIN)/haptic docs --out docs/reference/parameters.md
	$(BIN)/haptic docs --faults --out docs/reference/faults.md

site: setup
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "site: open site/index.html"

clean:
	rm -rf $(VENV) build install log dist site *.egg-info .pytest_cache .ruff_cache .mypy_cache .hypothesis .import_linter_cache
