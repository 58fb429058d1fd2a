# Two commands: `make demo` and `make test`.  Both set up what they need first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Files in the order in which they are collected
PYTEST := $(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder

# The nearest test files of those that changes since BASE reach, by imports and names: make near BASE=main~3 FILES=100
BASE ?= HEAD
FILES ?= 40
.PHONY: demo test quick near images full sanitize fuzz figures pictures lint setup clean

demo: setup
	$(BIN)/cutjoint simulate models/iltis.yaml --scene simul1 --integrator dormand-prince --out results/simul1.csv --plots results/simul1

test: setup
	$(PYTEST)

near: setup
	near=$$($(BIN)/python scripts/near $(BASE) $(FILES)) && if [ -n "$$near" ]; then $(PYTEST) $$near; fi

# What calls no C++ compiler, without derivations that take seconds
quick: setup
	$(PYTEST) -m "not heavy and not cpp and not slow"

# Every model turned, mirrored, shifted, renamed, cut elsewhere, and in other units: all images move as their original
images: setup
	$(BIN)/python -m pytest -n auto -m "heavy or not heavy" tests/images

# All tests, as before a release; tests of motions run generated code
full: setup
	$(PYTEST) -m "heavy or not heavy"
	$(BIN)/python scripts/sanitize
	$(BIN)/python scripts/sanitize --generic

sanitize: setup
	$(BIN)/python scripts/sanitize

fuzz: setup
	$(BIN)/python -m tests.fuzz $(or $(SECONDS),300) $(SEED)

# The studies of cutjoint_bench, each by its name; `of` are its modules where they have others, `with` their arguments
STUDIES := report tables beside bench methods newton batch sweep chain instructions realtime flags waits choice verification stiff errors branches loops starts roads driving imports
.PHONY: $(STUDIES) peers
$(STUDIES): %: setup
	for study in $(or $(of),$*); do $(BIN)/python -m cutjoint_bench.studies.$$study $(with) || exit; done

bench: of := iltis
flags: of := flags fmu_targets
instructions: of := instructions fmu
errors: of := estimates
# Modules of cutjoint drive under Node.js
driving: of := drive
beside: with := vehicle chain verification governor
# Robots that others wrote, as URDF with loops, beside Pinocchio: make imports ROBOTS=folder
imports: with := $(or $(ROBOTS),tests/importing)
beside report imports: peers

peers: setup
	$(BIN)/pip install --quiet --editable './measuring[peers]'

# Every figure and table of README and docs, from nothing: hours, on a machine that does nothing else.  What is in results/figures is not made again.
FIGURES := report tables beside pictures $(filter-out report tables beside imports driving, $(STUDIES))
.NOTPARALLEL: figures
figures: $(FIGURES:%=results/figures/%.txt)

results/figures/%.txt: | setup
	@mkdir -p $(@D)
	$(MAKE) --no-print-directory $* > $@.part
	mv $@.part $@

pictures: setup
	$(BIN)/python docs/pictures/simul1.py
	$(BIN)/python -m docs.pictures.models
	$(BIN)/python -m docs.pictures.rotor
	$(BIN)/cutjoint simulate models/press.yaml --out results/press.csv --plots results/press
	cp results/press/position.png docs/pictures/press.png

lint: setup
	$(BIN)/ruff check
	$(BIN)/mypy
	$(BIN)/lint-imports

setup: $(VENV)/.ready
	@scripts/require-cpp

$(VENV)/.ready: pyproject.toml measuring/pyproject.toml scripts/require-cpp
	scripts/require-cpp
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet --editable '.[test]' --editable measuring
	$(BIN)/cutjoint warm
	touch $@

clean:
	rm -rf $(VENV) results

# Wheels for Linux that run without a compiler, into dist/; Zig is their compiler. scripts/wheel --platform has Windows and macOS
.PHONY: wheel
wheel: setup
	$(BIN)/pip install --quiet --editable '.[wheel]'
	$(BIN)/python scripts/wheel

# Schemas, references, tables and generated code that are kept in git
.PHONY: regenerate
regenerate: setup
	$(BIN)/python scripts/regenerate
