# make demo   installs, then turns a spoken sentence into an animated face with the model in the package
# make test   installs everything, then runs the quick tests (under three minutes)
# make test-all   the three that follow
# make test-long      tests that take seconds: mutations, kills, real recordings, copies of the repository, pages
# make test-portable  the numeric tests as other processors would run them, those of files as on Windows
# make test-explore   the property tests with other random cases at every run
# make test-agents    the plug-ins for voice agents with both frameworks, in an environment of their own
# make check  lint, types, import contracts
# make coverage   the tests of `make test`, and which lines and branches they reach
# make fuzz   mutated input for every reader, MINUTES=10 in all; READER=name: that one only; SEED=1: other input
# make bench  the speed figures of docs/results/figures.md
# make model  trains and measures the model that ships with the package (needs GRID speaker s1)
# make site   the documentation as build/site/index.html: with a search, offline
# make requirements  renews the pinned requirements (needs uv)

PYTHON ?= python3
VENV ?= .venv
AGENTS ?= $(VENV)-agents
GRID ?= ../shared/corpora/grid-s1
BUILD ?= build
MINUTES ?= 10
SEED ?= 0
WORKERS ?= 2
READER ?=
BIN := $(VENV)/bin
# A module is compiled when it is first imported: most of what the packages hold never is.
INSTALL := -m pip --disable-pip-version-check install --quiet --no-compile
PIP := $(BIN)/python $(INSTALL)
SOURCES := $(shell find src -type f -not -name '*.pyc') pyproject.toml README.md
DRAWING := $(addprefix tests/,addons appearance architecture articulation cli/test_face.py cli/test_render.py engines export faces \
  formats fuzz hmm measures meshes motion oracles pipeline/film pipeline/test_scenes.py portable programs stats storage \
  studio study types units vision web)
TIMED := $(BIN)/python scripts/processor_time.py
PYTEST := $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal --slowest 20
.PHONY: demo test test-kernels test-drawing test-speech test-all test-long test-portable test-explore test-agents check coverage fuzz bench model site requirements clean
.DELETE_ON_ERROR:
# each run of pytest would read and rewrite all tests again
unexport PYTHONDONTWRITEBYTECODE

demo: $(VENV)/core
	mkdir -p $(BUILD)
	$(BIN)/lipmotion animate examples/welcome.flac --transcript examples/welcome.txt --face head -o $(BUILD)/welcome.mp4 $(BUILD)/welcome.json

# One process compiles the kernels; then two beside each other, each with tests of its own: what these load and train, they do
# once. One that draws and one that recognises words need 700 MB each, one that does both, or compiles, needs more.
test: $(VENV)/dev
	$(TIMED) --limit 500 make --no-print-directory --jobs=2 test-drawing test-speech

test-kernels: TESTS := tests/kernels
test-drawing: TESTS := $(DRAWING)
test-speech: TESTS := $(addprefix --ignore=,tests/kernels $(DRAWING))
test-drawing test-speech: test-kernels
test-kernels test-drawing test-speech: $(VENV)/dev
	$(BIN)/python -m pytest -m "not long" --slowest 20 $(TESTS)

test-all: test-long test-portable test-explore

test-long: $(VENV)/dev
	$(TIMED) --limit 1500 $(PYTEST) -m long

test-portable: $(VENV)/dev
	PYTHONPATH=tests $(TIMED) --limit 400 $(BIN)/python -m portable.run

test-explore: $(VENV)/dev
	$(PYTEST) -m "hypothesis and not long" --hypothesis-profile=explore

# their own warnings of what Python will remove are not ours
test-agents: $(AGENTS)/ready
	PYTHONPATH=src:extras $(AGENTS)/bin/python scripts/processor_time.py --limit 60 $(AGENTS)/bin/python -m pytest -W ignore::DeprecationWarning tests/agents

check: $(VENV)/dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# without the tests of full disks: the files of coverage itself would not fit
coverage: $(VENV)/dev
	$(BIN)/python -m coverage erase
	$(BIN)/python -m coverage run -m pytest -n $(WORKERS) --dist worksteal -m "not long" --ignore tests/cli/test_full_disk.py
	$(BIN)/python -m coverage combine --quiet
	$(BIN)/python -m coverage report

fuzz: $(VENV)/dev
	mkdir -p $(BUILD)
	PYTHONPATH=tests $(BIN)/python -m fuzz --minutes $(MINUTES) --seed $(SEED) $(addprefix --reader ,$(READER)) \
	  --found $(BUILD)/fuzz

bench: $(VENV)/dev
	$(BIN)/python benchmarks/main_path.py --grid $(GRID) --full

model: $(VENV)/dev
	mkdir -p $(BUILD)
	$(BIN)/lipmotion corpus prepare $(GRID) -o $(BUILD)/grid-s1
	$(BIN)/lipmotion train $(BUILD)/grid-s1 --from none -o $(BUILD)/grid-s1-train.lipmotion
	for split in val test; do \
	  $(BIN)/lipmotion evaluate $(BUILD)/grid-s1-train.lipmotion $(BUILD)/grid-s1 --split $$split -o docs/results/grid-s1-$$split.json; done
	$(BIN)/lipmotion train $(BUILD)/grid-s1 --from none --split all -o src/lipmotion/models/grid-s1.lipmotion

# The tools lie beside the environment of the tests, which stays as it is.
site: $(VENV)/site
	PYTHONPATH=src:$(VENV)/site-tools $(BIN)/python -m sphinx --fail-on-warning --keep-going --fresh-env --write-all --quiet \
	  -c docs -d $(BUILD)/site-cache . $(BUILD)/site

requirements:
	for list in core video dev site agents; do uv pip compile --universal --python-version 3.10 --generate-hashes --no-emit-index-url \
	  --no-annotate --no-header --override requirements/overrides.txt requirements/$$list.in -o requirements/$$list.txt; done

clean:
	rm -rf $(VENV) $(AGENTS) $(BUILD)

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

# The dev requirements hold the core ones: whichever came first, the package itself is always the newest.
$(VENV)/core: $(BIN)/python requirements/core.txt $(SOURCES)
	$(PIP) --no-deps --require-hashes -r requirements/core.txt
	$(PIP) --no-deps --no-build-isolation --force-reinstall .
	touch $@

$(VENV)/site: $(VENV)/dev requirements/site.txt
	$(PIP) --no-deps --require-hashes --upgrade --target $(VENV)/site-tools -r requirements/site.txt
	touch $@

$(VENV)/dev: $(BIN)/python requirements/dev.txt $(SOURCES)
	$(PIP) --no-deps --require-hashes -r requirements/dev.txt
	$(PIP) --no-deps --no-build-isolation --force-reinstall .
	touch $@

$(AGENTS)/ready: requirements/agents.txt
	$(PYTHON) -m venv $(AGENTS)
	$(AGENTS)/bin/python $(INSTALL) --no-deps --require-hashes -r requirements/agents.txt
	touch $@
