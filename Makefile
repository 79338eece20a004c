# make demo | train | test | test-slow | test-xslow | test-oldest | docs | links | release-check | bench | bench-rivals | check | format      (a Python of 3.11 or newer is all that is needed)
PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python
MARK := not slow
TASK ?= push
EXTRAS := warp,cli$(shell nvidia-smi -L >/dev/null 2>&1 && echo ',cuda')

.PHONY: demo train test test-slow test-xslow test-oldest docs links release-check bench bench-rivals check format
demo: $(VENV)/installed
	@$(RUN) -m mjx_arenas demo

train: $(VENV)/train
	@$(RUN) -m mjx_arenas train $(TASK) $(ARGS)

test: $(VENV)/dev $(VENV)/robots/installed
	MJX_ARENAS_ROBOTS=$(abspath $(VENV))/robots $(RUN) -m pytest -n 2 --dist loadfile --no-loadscope-reorder -m "$(MARK)" $(ARGS)

# what is slow: physics, most oracles on Warp, what compiles for more than some seconds, and by nature trainings, notebooks, robots' meshes, child processes, benchmarks
test-slow:
	@$(MAKE) test MARK=slow

# the slow tests of more models, sizes and kinds: before a release, and each week
test-xslow:
	@$(MAKE) test MARK=xslow

test-oldest:
	$(MAKE) test VENV=.venv-oldest CONSTRAINTS=tests/oldest.txt MARK=

# the site, in out/site; a warning is an error
docs: $(VENV)/docs
	NO_MKDOCS_2_WARNING=1 $(RUN) -m mkdocs build --strict --quiet

# whether all pages of others are there that the documentation links to; needs a network
links: $(VENV)/installed
	@$(RUN) tools/links.py

# the wheel and the sdist, installed and tried in environments of their own
release-check: $(VENV)/release
	$(RUN) tools/release_check.py $(ARGS)

# make bench ARGS="randomize kinds"
bench: $(VENV)/installed
	@$(RUN) -m pip install --disable-pip-version-check --quiet -e '.[bench]'
	@$(RUN) -m benchmarks $(ARGS)
	@$(RUN) -m benchmarks.plots

bench-rivals: .venv-robosuite/installed .venv-mjlab/installed
	@$(MAKE) bench ARGS="robosuite mjlab mjlab_terms"

check: $(VENV)/dev
	$(RUN) -m ruff format --check .
	$(RUN) -m ruff check .
	$(RUN) -m pyright

format: $(VENV)/dev
	$(RUN) -m ruff format .
	$(RUN) -m ruff check --fix .

$(VENV)/installed: pyproject.toml
	@$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(v < (3, 11) and f"mjx_arenas needs Python 3.11 or newer, $(PYTHON) is {v[0]}.{v[1]}: make PYTHON=python3.12 ...")'
	@echo "Setting up $(VENV) (once; the downloads take a few minutes, and pip says nothing meanwhile) ..."
	@$(PYTHON) -m venv $(VENV) || { echo "python3 -m venv failed; on Debian and Ubuntu: apt install python3-venv"; exit 1; }
	@$(RUN) -m pip install --disable-pip-version-check --quiet -e '.[$(EXTRAS)]' $(if $(CONSTRAINTS),-c $(CONSTRAINTS))
	@touch $@

$(VENV)/dev $(VENV)/train $(VENV)/docs $(VENV)/release: $(VENV)/installed
	@$(RUN) -m pip install --disable-pip-version-check --quiet -e '.[$(notdir $@)]' $(if $(CONSTRAINTS),-c $(CONSTRAINTS))
	@touch $@

$(VENV)/robots/installed: tests/robots.txt $(VENV)/installed
	@$(RUN) -m pip install --disable-pip-version-check --quiet --no-deps --upgrade --target $(VENV)/robots -r tests/robots.txt
	@touch $@

.venv-%/installed: benchmarks/%.txt
	@$(PYTHON) -m venv .venv-$*
	@.venv-$*/bin/python -m pip install --disable-pip-version-check --quiet -r $<
	@touch $@
