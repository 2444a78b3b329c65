# make demo   set everything up and run the UR10 assembly workstation live
# make demo-xr   a cell to walk into with an emulated headset, in a desktop browser
# make demo-plc   a cell with a robot controller and a PLC, both emulated; the PLC dies and comes back
# make test   set everything up and run every check
#
# Everything is installed into .venv and web/node_modules, with versions locked in requirements/ and
# web/package-lock.json. What it needs beside: Python >= 3.11, make; Debian packages are installed when
# missing and allowed, else the message says which.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUN := $(VENV)/.run
DEV := $(VENV)/.dev
NODE := $(VENV)/.node
PAGE := src/seerob/app/server/page/index.html
LOOPS := $(VENV)/.loops
BROUGHT := src/seerob/kernels/compiled
KEPT := $(VENV)/.compiled
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: help demo demo-plc demo-xr test setup check compiled format lint types imports unit web-test web-test-told-later browser package bench soak mutate wire web build docs docs-site docs-versions lock audit clean

help:
	@sed -n 's/^# \(make .*\)/\1/p' Makefile
	@echo "also: check format unit web-test package bench soak mutate wire web build docs docs-site docs-versions lock audit clean"

# -- the two commands ---------------------------------------------------------------------------

# Inner loops are compiled while packages of the page are fetched.
demo: $(RUN)
	$(MAKE) --no-print-directory -j2 $(KEPT) $(PAGE)
	$(BIN)/seerob run workstations/ur10_assembly || [ $$? -le 2 ]  # 1 and 2 are verdicts, not failures

demo-xr: $(DEV) $(PAGE)
	scripts/demo-xr $(BIN) || [ $$? -le 2 ]

demo-plc: $(DEV) $(PAGE)
	scripts/demo-plc $(BIN) || [ $$? -le 2 ]

# What is fetched, compiled and installed keeps one core busy each. Tests want both, and leave them idle a
# quarter of the time: a page waits for its pictures, a source for its device. So all run beside each other, and
# what the page's tests say comes at the end.
test: $(RUN) $(NODE)
	$(MAKE) --no-print-directory -j3 $(DEV) $(LOOPS)/.made $(PAGE) browser
	CHROMIUM="$$(scripts/find-browser)" && export CHROMIUM && $(MAKE) --no-print-directory -j4 FIRST=compiled check package unit web-test-told-later

# And mono for the C# client, after it: two installations of packages would wait for each other.
browser:
	scripts/find-browser >/dev/null
	{ command -v mcs && command -v mono; } >/dev/null || scripts/apt-install mono-mcs mono-runtime || true

unit web-test-told-later: $(FIRST)

web-test-told-later: $(DEV) $(PAGE)
	$(MAKE) --no-print-directory web-test >$(VENV)/.web-test 2>&1 && code=0 || code=$$?; cat $(VENV)/.web-test; exit $$code

# -- set-up -------------------------------------------------------------------------------------

$(VENV)/bin/python:
	scripts/make-venv $(PYTHON) $(VENV)

$(RUN): $(VENV)/bin/python requirements/run.txt pyproject.toml
	$(BIN)/python -m pip install -q --require-hashes -r requirements/run.txt
	$(BIN)/python -m pip install -q --no-deps --no-build-isolation --require-hashes -r requirements/build.txt
	$(BIN)/python -m pip install -q --no-deps --no-build-isolation -e .
	touch $@

$(KEPT): $(RUN) $(wildcard src/seerob/kernels/*.py)
	$(BIN)/python -c "from seerob.app.console.progress import compile_loops; compile_loops()"
	touch $@

$(DEV): $(RUN) requirements/dev.txt
	$(BIN)/python -m pip install -q --no-compile --require-hashes -r requirements/dev.txt
	touch $@

$(NODE): $(VENV)/bin/python requirements/node.txt
	scripts/find-node $(VENV)
	touch $@

web/node_modules/.installed: web/package-lock.json $(NODE)
	cd web && ../scripts/npm ci --no-audit --no-fund
	touch $@

$(PAGE): web/node_modules/.installed $(shell find web/src web/public web/index.html web/vite.config.ts web/three_garbage.ts web/pack.mjs -type f 2>/dev/null)
	cd web && ../scripts/npm run build
	touch $@

setup: $(DEV) $(PAGE)

# -- checks -------------------------------------------------------------------------------------

check: $(DEV) lint types imports
	$(BIN)/python -m seerob.app.wire --check

lint: $(DEV)
	$(BIN)/ruff format --check
	$(BIN)/ruff check

types: $(DEV)
	$(BIN)/mypy

imports: $(DEV)
	$(BIN)/lint-imports

# What the workers of `unit` would all compile at the same time: modules and inner loops.
compiled: export PYTHONDONTWRITEBYTECODE :=
compiled: $(DEV) $(PAGE) $(LOOPS)/.made
	mkdir -p $(BROUGHT) && find $(LOOPS) -name '*.nb?' -exec cp -p {} $(BROUGHT) \;
	said=$$($(BIN)/pytest --collect-only -qq) || { echo "$$said"; exit 1; }
	folder=$$(mktemp -d) && trap 'rm -rf "$$folder"' EXIT && $(BIN)/seerob new "$$folder/cell" >/dev/null && \
	{ $(BIN)/seerob assess "$$folder/cell" -o "$$folder/out" >/dev/null || [ $$? -le 2 ]; }

# Without it, every process that a test starts compiles every library again.
unit: export PYTHONDONTWRITEBYTECODE :=
# Workers occupy the processors; threads of a library's own would wait for each other there.
unit: export OPENBLAS_NUM_THREADS := 1
unit: $(DEV) $(PAGE)
	CHROMIUM="$$(scripts/find-browser)" && export CHROMIUM && $(BIN)/pytest -n 3 --dist loadfile

web-test: $(DEV) $(PAGE)
	CHROMIUM="$$(scripts/find-browser)" && export CHROMIUM && cd web && ../scripts/npm run check && ../scripts/npm run lint && ../scripts/npm test

# Inner loops that a wheel brings, for processors of others.
$(LOOPS)/.made: $(RUN) scripts/compile-loops $(wildcard src/seerob/kernels/*.py)
	$(BIN)/python scripts/compile-loops $(LOOPS)
	touch $@

package: $(PAGE) $(LOOPS)/.made
	scripts/test-wheel $(BIN)/python $(LOOPS)

# -- other work ---------------------------------------------------------------------------------

bench: $(DEV)
	for file in benchmarks/[a-z]*.py; do echo "== $$file"; $(BIN)/python $$file; done

# KINDS="rtde opcua" KILLS=1000: only live sources, these of them, so many kills. Hours without.
soak: $(DEV)
	$(if $(KINDS)$(KILLS),SEEROB_SOAK_KINDS="$(KINDS)" SEEROB_SOAK_KILLS=$(or $(KILLS),1000) $(BIN)/pytest -m soak -rP tests/soak/test_live_sources.py,$(BIN)/pytest -m soak)

format: $(DEV)
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

wire: $(DEV)
	$(BIN)/python -m seerob.app.wire

web: $(PAGE)

# A wheel for every platform, and one for this Python on this platform that brings its loops.
build: $(DEV) $(PAGE) $(LOOPS)/.made
	rm -rf dist
	$(BIN)/python -m build --no-isolation --wheel --sdist
	SEEROB_LOOPS=$(LOOPS) $(BIN)/python -m build --no-isolation --wheel
	$(BIN)/python scripts/sbom dist/seerob.cdx.json

# Known flaws of what is locked: asks the advisory database, fails where that does not answer, and needs pip-audit
# (pipx install pip-audit).
audit:
	pip-audit --strict --require-hashes --disable-pip -r requirements/run.txt
	pip-audit --strict --require-hashes --disable-pip -r requirements/dev.txt

# Each limit, sign, unit and comparison of the verdicts changed in turn: minutes.
mutate: $(DEV)
	$(BIN)/python scripts/mutate

# The documentation site in .site/html, for any web server or to be opened from the disk.
docs-site: $(DEV)
	$(BIN)/python scripts/site_pages .site/pages
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

# Every release's and this checkout's, each page with a choice of versions: what is published.
docs-versions: $(DEV)
	NO_MKDOCS_2_WARNING=1 $(BIN)/python scripts/site_versions .site/versions

docs: $(DEV)
	$(BIN)/python scripts/write-docs

# New versions: run, read the difference, run the tests, commit.
lock: $(DEV)
	scripts/lock $(BIN)/python

clean:
	rm -rf $(VENV) web/node_modules dist .site src/seerob/app/server/page $(BROUGHT) .mypy_cache .ruff_cache .pytest_cache
