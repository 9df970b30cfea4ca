# Two commands do all the set-up: `make demo` and `make test`. `make help` lists the rest.

PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
LEARNING := gymnasium stable-baselines3 torch tensorboard
LOCKED := --disable-pip-version-check --quiet --require-hashes
UV_COMPILE = $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes \
	--no-emit-package haustra --custom-compile-command 'make lock' $(UPGRADE) pyproject.toml -

.PHONY: help demo test tests thorough bench lint format types docs wheel wheels page lock clean
.DELETE_ON_ERROR:

help:
	@echo 'make demo    grow a colon, build its wall, let a policy drive a scope to the caecum: reports and a film'
	@echo 'make test    lint, types and tests, as the project checks itself'
	@echo 'make thorough  tests that repeat others with more values, or at length'
	@echo 'make bench   run time against error, stability, skipping: some ten minutes, one page'
	@echo 'make docs    build the documentation into site/'
	@echo 'make wheel   build the wheel and try it in an empty environment'
	@echo 'make wheels  try it with each extra, too, each in an empty environment'
	@echo 'make format  format and fix what ruff can'
	@echo 'make page    build the console page from its source (needs npm; its result is committed)'
	@echo 'make lock    renew the lock files from pyproject.toml (UPGRADE=--upgrade for newer versions)'
	@echo 'make clean   remove the environment and everything that was built'

demo: $(VENV)/.installed
	$(BIN)/haustra colon grow --seed 100000 -o demo/colon
	$(BIN)/haustra wall demo/colon --method coacd
	$(BIN)/haustra run --colon demo/colon --driver insertion --seconds 240 --film -o demo/run
	$(BIN)/haustra run --colon demo/colon --fixed --wall-law pieces --seconds 5 -o demo/fixed
	@echo
	@echo 'Open $(CURDIR)/demo/run/report.html, which plays the run, and demo/run/film.webp;'
	@echo 'demo/fixed/report.html has the same colon held still, as a wall of convex pieces'

# Types are checked while tests run, which leave pyright's one thread some of two cores.
test: lint
	$(MAKE) --no-print-directory --jobs 2 types tests

# A process a core, up to four since each takes a gigabyte, and one thread for numpy's BLAS: on small matrices and two cores, more of them wait for each other far longer than they compute.
# Each process goes on where it is, so that neighbours share what they set up, and takes of another's rest when it has none.
tests: $(VENV)/.installed-dev
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -m "not thorough" --numprocesses auto --maxprocesses 4 --dist worksteal $(PYTEST_ARGUMENTS)

thorough: $(VENV)/.installed-dev
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -m thorough --numprocesses auto --maxprocesses 4

bench: $(VENV)/.installed-dev
	$(BIN)/haustra bench --quick -o bench
	@echo
	@echo 'Open $(CURDIR)/bench/report.html'

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check

types: $(VENV)/.installed-dev
	$(BIN)/pyright --pythonpath $(BIN)/python

format: $(VENV)/.installed-dev
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

docs: $(VENV)/.installed-dev
	$(BIN)/python -m haustra.scripts.bench.pages.numbers_page docs/numbers.md
	$(BIN)/python -m haustra.scripts.bench.pages.capabilities_page docs/decisions/capabilities.md
	$(BIN)/python -m haustra.scripts.bench.pages.errors_page docs/validation/errors.md
	$(BIN)/python -m haustra.scripts.bench.pages.fields_page docs/fields.md
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

wheel: $(VENV)/.installed-dev
	rm -rf build dist
	$(BIN)/python -m build --wheel --no-isolation >/dev/null
	$(PYTHON) -m venv build/empty
	build/empty/bin/python -m pip install $(LOCKED) -r requirements.lock
	build/empty/bin/python -m pip install --disable-pip-version-check --quiet --no-deps dist/*.whl
	cd build && empty/bin/haustra doctor

wheels: wheel
	$(BIN)/python -m pip install --quiet uv
	PYTHON=$(PYTHON) .ci/wheels

page:
	cd envs/console/page/source && npm ci --ignore-scripts=false && npm run build

lock: $(VENV)/.created
	$(BIN)/python -m pip install --quiet uv
	echo 'setuptools>=77' | $(UV_COMPILE) -o requirements.lock
	echo 'setuptools>=77' | $(UV_COMPILE) --extra dev --constraint requirements.lock -o requirements-dev.lock

clean:
	rm -rf $(VENV) build dist site demo *.egg-info

$(VENV)/.created:
	$(if $(PYTHON),,$(error Python 3.11 or newer is needed: install it, or name it with PYTHON=/path/to/python))
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed: name it with PYTHON=")'
	$(PYTHON) -m venv $(VENV)
	@touch $@

# The lock holds setuptools too, so the editable install needs no build isolation and no further download.
$(VENV)/.installed: requirements.lock pyproject.toml | $(VENV)/.created
	$(BIN)/python -m pip install $(LOCKED) -r requirements.lock
	$(BIN)/python -m pip install --disable-pip-version-check --quiet --no-deps --no-build-isolation -e .
	@touch $@

# Holds everything of .installed at the same versions, so that one stands for both.
$(VENV)/.installed-dev: requirements-dev.lock requirements.lock constraints-rl.txt pyproject.toml | $(VENV)/.created
	$(BIN)/python -m pip install $(LOCKED) -r requirements-dev.lock
	$(BIN)/python -m pip install --disable-pip-version-check --quiet --no-deps --no-build-isolation -e .
	$(BIN)/python -m pip install --disable-pip-version-check --quiet -c constraints-rl.txt $(LEARNING)
	@touch $@ $(VENV)/.installed
