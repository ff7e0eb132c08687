# Needs Python 3.11 or newer; everything else goes into .venv.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
WORKERS ?= 2
# Marks of the tests that `make test` runs.
TESTS ?= not long and not nightly
# How many random examples: quick ones draw 50, repeatable ones 100.
EXAMPLES ?= quick
MUTANTS ?= 160
# Versions that every environment gets, on any Python; LOCK= takes the newest that there are.
LOCK ?= requirements.lock
INSTALLER ?= $(BIN)/pip install --disable-pip-version-check
INSTALL = $(INSTALLER) --quiet $(LOCK:%=--constraint %) --editable
BENCH = $(BIN)/python benchmarks/bench_history.py run
# The workers share the cores already.
PYTEST = MPLBACKEND=Agg OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal

# Each process of the tests would compile every file again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test long nightly bench bench-check mutants tables cross claims docs site-versions check release-check notebooks lock clean

demo: $(VENV)/installed
	$(BIN)/drake-rnn run slc_nephroid_warm_up --out out

test: $(VENV)/installed-dev
	$(PYTEST) --hypothesis-profile $(EXAMPLES) -m "$(TESTS)"

long: $(VENV)/installed-dev
	$(PYTEST) -m "long and not nightly"

nightly: $(VENV)/installed-dev
	$(PYTEST) -m nightly
	$(BIN)/python benchmarks/bench_history.py check

# Tables, and a line of each figure in build/bench/history.jsonl, drawn in history.svg beside it.
bench: $(VENV)/installed-dev
	$(BENCH) benchmarks/start_bench.py
	$(BENCH) benchmarks/bench.py
	$(BENCH) benchmarks/contact_bench.py
	$(BENCH) benchmarks/batch_kinematics.py
	$(BENCH) benchmarks/many.py
	$(BENCH) benchmarks/compiled.py --steps-in-c
	$(BENCH) benchmarks/compiled.py --ticks
	$(BENCH) benchmarks/compiled.py --among-obstacles
	$(BENCH) benchmarks/avoidance_cost.py
	$(BENCH) benchmarks/avoidance_cost.py --jerk 20
	$(BENCH) benchmarks/avoidance_cost.py --fine
	$(BENCH) benchmarks/guard_times.py
	$(BENCH) benchmarks/run_bench.py
	$(BIN)/python benchmarks/bench_history.py draw

# Whether a ratio of the newest commit is more than a tenth above those before.
bench-check: $(VENV)/installed-dev
	$(BIN)/python benchmarks/bench_history.py check

mutants: $(VENV)/installed-mutants
	MPLBACKEND=Agg OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 \
	  $(BIN)/python tests/mutants/mutants.py $(MUTANTS)

tables: $(VENV)/installed
	$(BIN)/python benchmarks/state_adjustment_tables.py
	$(BIN)/python benchmarks/joint_drift_free_tables.py
	$(BIN)/python benchmarks/recursive_tables.py
	$(BIN)/python benchmarks/motion_force_tables.py
	$(BIN)/python benchmarks/touch_tables.py
	$(BIN)/python benchmarks/simultaneous_learning_tables.py
	$(BIN)/python benchmarks/adaptive_tables.py

cross: $(VENV)/installed
	$(BIN)/python benchmarks/cross.py > docs/cross.md
	$(BIN)/python docs/stale_tables.py --remade docs/cross.md

claims: $(VENV)/installed
	$(BIN)/python docs/make_claims.py docs

# The site, in build/site: open build/site/index.html. It needs no network.
SPHINXOPTS ?= -W
docs: $(VENV)/installed-docs
	rm -rf build/site
	$(BIN)/python docs/make_gallery.py build/gallery/docs/playbacks
	$(BIN)/sphinx-build -b html -c docs -d build/doctrees --keep-going --quiet $(SPHINXOPTS) . build/site

# This version and an older one beside each other, in build/sites, for any web server; Read the Docs
# does so itself. The older one has its own pages, and all else as here: menu of versions, search,
# looks. Its warnings are let be, as it is released: make site-versions STABLE=v0.3.0
STABLE ?= $(shell git describe --tags --abbrev=0 2>/dev/null)
BESIDE = -A site_versions=latest,stable -A site_version
site-versions:
	@test -n "$(STABLE)" || { echo "no tag; give a commit: make site-versions STABLE=..."; exit 1; }
	rm -rf build/sites
	test -e build/stable || git clone --quiet . build/stable
	git -C build/stable fetch --quiet --tags
	git -C build/stable checkout --quiet --force $(STABLE)
	cp -r docs/conf.py docs/site build/stable/docs/
	test -e build/stable/requirements.lock || cp requirements.lock build/stable
	$(MAKE) docs SPHINXOPTS="-W $(BESIDE)=latest"
	$(MAKE) -C build/stable -f $(CURDIR)/Makefile docs VENV=.venv SPHINXOPTS="$(BESIDE)=stable"
	mkdir build/sites
	mv build/site build/sites/latest
	mv build/stable/build/site build/sites/stable
	sed s,docs/,stable/docs/, docs/site/root/index.html > build/sites/index.html

check: $(VENV)/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

# What an upload would be refused for, or would mislead: metadata, sizes, contents, licences.
release-check: $(VENV)/installed-dev
	$(BIN)/python docs/check_release.py

# The notebooks, each where nothing but its first cell installs anything.
notebooks: $(VENV)/installed-dev
	rm -rf build/notebook_wheel
	$(BIN)/python -m build --wheel --outdir build/notebook_wheel .
	$(BIN)/python docs/make_notebooks.py --run build/notebook_wheel/*.whl

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "drake_rnn needs Python 3.11 or newer; give one with make PYTHON=..."; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/installed: $(VENV)/bin/python pyproject.toml $(LOCK)
	$(INSTALL) .
	touch $@

$(VENV)/installed-dev: $(VENV)/bin/python pyproject.toml $(LOCK)
	$(INSTALL) '.[dev]'
	touch $@ $(VENV)/installed

$(VENV)/installed-docs: $(VENV)/bin/python pyproject.toml $(LOCK)
	$(INSTALL) '.[docs]'
	touch $@ $(VENV)/installed

$(VENV)/installed-mutants: $(VENV)/installed-dev $(LOCK)
	$(INSTALL) '.[mutants]'
	touch $@

# Extras of the environments that the targets above make; peers of others need other versions.
LOCKED = dev docs jax looks mutants
COMPILE = $(VENV)/lock/bin/uv pip compile pyproject.toml --quiet --no-header --no-annotate

# The newest versions, for every Python and platform at once.
lock: $(VENV)/lock/bin/uv
	$(COMPILE) --upgrade --universal --python-version 3.11 $(LOCKED:%=--extra %) \
	  --output-file requirements.lock

# The oldest versions that pyproject.toml admits: make test LOCK=build/oldest.lock VENV=build/oldest
build/oldest.lock: $(VENV)/lock/bin/uv pyproject.toml
	mkdir -p build
	$(COMPILE) --resolution lowest-direct --python-version 3.11 --extra dev --output-file $@

$(VENV)/lock/bin/uv: $(VENV)/bin/python
	$(BIN)/python -m venv $(VENV)/lock
	$(VENV)/lock/bin/pip install --quiet --disable-pip-version-check uv

clean:
	rm -rf out notebooks/out build dist *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
