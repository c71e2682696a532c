# make design   the main task: the paper's design for its cylinder, the recommended one, and how they compare, in run/
# make test     the tests, C++ and Python; of those that take long, one in eight
# Both set up what a bare Debian with Python 3.11 lacks: system packages (as root; an ordinary user is told which) and a
# virtual environment in .venv. `make design` compiles for this machine alone; what is for developers, for every level
# that it has.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Tests of a file stay on one core: what they share is made once.
PARALLEL := -n auto --dist loadfile
PACKAGES := g++ cmake ninja-build make python3-dev python3-venv libeigen3-dev doctest-dev
SOURCES := CMakeLists.txt pyproject.toml $(shell find cpp python -name '*.[ch]pp' -o -name '*.py' -o -name '*.pyi' -o -name '*.map')

.PHONY: design test test-long test-cpp test-python test-levels bench cost sanitize race lint format stubs docs docs-pages clean
.DELETE_ON_ERROR:

design: $(VENV)/.installed
	$(BIN)/fisherpoint design examples/paper.toml -o run/paper --force
	$(BIN)/fisherpoint design examples/cylinder.toml -o run/recommended --force
	$(BIN)/fisherpoint compare examples/cylinder.toml run/paper/design.csv run/recommended/design.csv -o run/compared --force

test: export FISHERPOINT_LONG_TESTS ?= 0/8
test: test-cpp test-python test-levels

test-long: $(VENV)/.developer
	$(BIN)/python -m pytest $(PARALLEL) -m long

# What packs and kernels compute, optimised, on every level; and with the methods on small models under the sanitizers.
test-cpp: $(VENV)/.system sanitize
	cmake --preset release
	cmake --build --preset release
	ctest --preset release

test-python: $(VENV)/.developer
	$(BIN)/python -m pytest $(PARALLEL)

# The kernels' tests on the levels that `test-python`, which takes the best one, leaves out: each test on one of them, by its name.
test-levels: $(VENV)/.developer
	@set -e; set -- $$($(BIN)/python -c 'import fisherpoint as fp; print(*fp.instruction_sets()[:-1])'); k=0; \
	for level in "$$@"; do \
	  echo "x86-64-$$level"; FISHERPOINT_ISA=$$level FISHERPOINT_TEST_SHARE=$$k/$$# $(BIN)/python -m pytest -q $(PARALLEL) \
	    -m kernels $$(grep -l 'mark[.]kernels' tests/python/test_*.py); \
	  k=$$((k + 1)); \
	done

bench: $(VENV)/.developer
	$(BIN)/python -m bench

cost: $(VENV)/.developer
	$(BIN)/python -m bench cost

sanitize: $(VENV)/.system
	cmake --preset sanitize
	cmake --build --preset sanitize
	ctest --preset sanitize

race: $(VENV)/.system
	cmake --preset tsan
	cmake --build --preset tsan
	ctest --preset tsan

lint: $(VENV)/.developer
	$(BIN)/clang-format --dry-run --Werror $$(find cpp tests/cpp bench -name '*.[ch]pp')
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache
	$(BIN)/mypy docs/scripts
	$(BIN)/python cpp/bindings/generate_stubs.py --check

format: $(VENV)/.developer
	$(BIN)/clang-format -i $$(find cpp tests/cpp bench -name '*.[ch]pp')
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

stubs: $(VENV)/.developer
	$(BIN)/python cpp/bindings/generate_stubs.py

# The site, in build/site, with warnings as errors.
docs: $(VENV)/.developer
	$(BIN)/python docs/scripts/configuration.py --check
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict  # --quiet would hide the warnings from --strict

# The pages that are made from the program; pictures of examples only where they are out of date, each in up to a minute.
docs-pages: $(VENV)/.developer
	$(BIN)/python docs/scripts/configuration.py
	$(BIN)/python docs/scripts/tutorials.py
	$(BIN)/python docs/scripts/gallery.py

# What is missing is found by use, not by package name: a compiler or Python from elsewhere serves as well.
$(VENV)/.system:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "expected Python 3.11 or later, given $$($(PYTHON) --version 2>&1): set PYTHON=..."; exit 1; }
	@if ! { command -v g++ && command -v cmake && command -v ninja && $(PYTHON) -c 'import venv, ensurepip' \
	  && test -f "$$($(PYTHON) -c 'import sysconfig; print(sysconfig.get_path("include"))')/Python.h" \
	  && test -f /usr/include/eigen3/Eigen/Core && test -f /usr/include/doctest/doctest.h; } >/dev/null 2>&1; then \
	  if [ "$$(id -u)" != 0 ]; then echo "expected the system packages; as root: apt-get install $(PACKAGES)"; exit 1; fi; \
	  apt-get update -q && DEBIAN_FRONTEND=noninteractive apt-get install -qy --no-install-recommends $(PACKAGES); \
	fi
	@mkdir -p $(VENV) && touch $@

$(VENV)/.installed: $(VENV)/.system $(SOURCES)
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet '.[all]'
	@touch $@

$(VENV)/.developer: $(VENV)/.system $(SOURCES)
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade 'pip>=25.1'  # the first that knows groups
	FISHERPOINT_ISAS=supported $(BIN)/python -m pip install --quiet '.[all]' --group dev
	@touch $(VENV)/.installed $@

clean:
	rm -rf $(VENV) build
