# Every target sets itself up: a virtual environment in .venv, versions pinned by constraints.txt.
PYTHON ?= python3
VENV ?= .venv
WORKERS ?= 2
# A file at a time, so that what a module shares is made once; files in the order of tests/conftest.py, slow ones first.
SHARED_OUT = --numprocesses $(WORKERS) --dist loadfile --no-loadscope-reorder
BIN := $(VENV)/bin
# Of some 16 000 modules few are imported, and compiled then, once.  Containers often forbid Python to keep what it has
# compiled: each of the many processes of the tests would then take seconds to compile torch and all else anew.
PIP := -m pip install --quiet --no-compile
export PYTHONDONTWRITEBYTECODE :=

.PHONY: install install-dev install-oldest demo test test-slow test-oldest coverage lint docs pages clean

install: $(VENV)/.installed
install-dev: $(VENV)/.installed-dev

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python $(PIP) --constraint constraints.txt --editable .
	touch $@

$(VENV)/.installed-dev: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python $(PIP) --constraint constraints.txt --editable ".[dev]"
	$(BIN)/python $(PIP) --constraint constraints.txt --no-deps mmagic  # only its NIQE files are used
	touch $(VENV)/.installed $@

demo: install
	$(BIN)/spikecam demo

# Which renderer works is tried once: each of the many processes that draw would try it for itself.
CHOSEN = $(BIN)/python -c "from scenes.renderers.choose import chosen; print(chosen())"

# What takes long by nature, such as diagnoses from end to end and learning, is marked slow.
test: MARKED = not slow
test-slow: MARKED = slow
test test-slow: install-dev
	SPIKECAM_RENDERER=$${SPIKECAM_RENDERER:-$$($(CHOSEN))} $(BIN)/python -m pytest $(SHARED_OUT) -m '$(MARKED)'

# The oldest releases that pyproject.toml allows (constraints-oldest.txt), in an environment of their own, without the
# slow tests; numba's compiled code of one release is no use to another, so it goes to a folder of its own too.
OLDEST := $(VENV)-oldest
# Every dependency by what uses most of it: files, options, scenes with their renderers, environments with their wrappers.
OLDEST_TESTS := $(addprefix tests/,test_requirements.py test_untrusted.py streams cli scenes/test_catalogue.py \
	scenes/test_film.py scenes/test_mesh_files.py scenes/test_mujoco_light.py scenes/renderers envs/test_rotating_disk.py envs/test_observations.py \
	envs/test_wrappers.py)

$(OLDEST)/.installed: pyproject.toml constraints-oldest.txt
	$(PYTHON) -m venv $(OLDEST)
	$(OLDEST)/bin/python $(PIP) --constraint constraints-oldest.txt --editable ".[mujoco]" pytest pytest-xdist hypothesis
	touch $@

install-oldest: $(OLDEST)/.installed

test-oldest: install-oldest
	NUMBA_CACHE_DIR=$(abspath $(OLDEST))/numba $(OLDEST)/bin/python -m pytest -W ignore::DeprecationWarning \
		$(SHARED_OUT) -m 'not slow' $(OLDEST_TESTS)

# Share of lines that the tests run, without the slow ones; TESTS="tests/streams tests/cli" names fewer.
TESTS ?= tests
coverage: install-dev
	$(BIN)/python -m coverage erase
	$(BIN)/python -m coverage run -m pytest $(SHARED_OUT) -m 'not slow' $(TESTS)
	$(BIN)/python -m coverage combine --quiet
	$(BIN)/python -m coverage report

# The committed diagnoses of real recordings, where these are at hand, and every figure about them in docs.
pages: install-dev
	$(BIN)/python -m tools.pages

# The site of docs, in docs/_build: warnings are errors, and nothing is fetched to build or to show it.
docs: install-dev
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --fresh-env --quiet -b html docs docs/_build

lint: install-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python -m tools.function_sizes
	$(BIN)/python -m tools.words >/dev/null || $(BIN)/python -m tools.words
	$(BIN)/python -c 'import sys; sys.exit(sys.version_info >= (3, 11))' || $(BIN)/mypy  # the numpy of 3.10 has other types
	$(BIN)/lint-imports

clean:
	rm -rf $(VENV) $(VENV)-oldest build docs/_build .coverage *.egg-info
