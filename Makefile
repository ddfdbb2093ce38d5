# Two commands are the whole set-up: `make bench` and `make test`.

PYTHON ?= python3
BIN := .venv/bin

.PHONY: help bench demo test check docs results install install-dev benchmark reliability same-bits release clean

help: ## Show the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1: /p' Makefile

bench: install ## Install into .venv, run the quick study and write its report
	$(BIN)/bench run quick --out results/quick
	$(BIN)/bench report results/quick

demo: install ## The same with the smallest study, in minutes
	$(BIN)/bench run smoke --out results/smoke
	$(BIN)/bench report results/smoke

test: install-dev check ## Install with all extras, then lint, types, import rules and tests
	$(BIN)/pytest --numprocesses 2 --dist loadfile --no-loadscope-reorder

check: install-dev ## Lint, types and import rules
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: install-dev ## Write the API pages to build/api, from the docstrings
	MUJOCO_GL=disable PDOC_ALLOW_EXEC=1 $(BIN)/pdoc -d google -o build/api bench methods reports tasks \
		$(subst /,.,$(basename $(filter-out %/__init__.py,$(wildcard bench/*.py))))

results: install ## Write the tables and figures of the shipped results into the documents
	$(BIN)/bench report --reference --out build/reference
	$(BIN)/python docs/refresh.py build/reference README.md docs/results.md docs/beyond_the_paper.md
	$(BIN)/python docs/run_notebook.py docs/explore-results.ipynb
	cd build/reference/figures && cp success.png figure_5.png table_9.png two_experts_test.png disturbed.png efficiency.png $(CURDIR)/docs/images

benchmark: install-dev ## Measure speed against peers, half an hour
	$(BIN)/pytest benchmarks --timeout 0 --benchmark-columns=median,iqr,rounds

reliability: install-dev ## Kill, interrupt and damage runs some 200 times, hours
	$(BIN)/pytest tests/bench/test_reliability.py tests/bench/test_backend.py \
		tests/bench/test_fuzz.py tests/bench/test_hostile.py tests/methods/test_kodex.py -m 'not release' --times 200 --timeout 0

same-bits: install-dev ## Check that this processor computes the bits of others, and note it, half an hour
	$(BIN)/pytest tests/bench/test_same_bits.py tests/bench/test_emulated.py -m 'long or not long' --timeout 0
	$(BIN)/python tests/helpers/same_bits.py

release: install-dev ## Build wheel and sdist and try each in an empty environment, minutes
	$(BIN)/pytest tests/test_release.py -m release

install: .venv/installed ## Create .venv with what running needs
install-dev: .venv/installed-dev ## Create .venv with what developing needs

clean: ## Remove .venv and caches
	rm -rf .venv .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis *.egg-info

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "Python 3.11 or later is needed; $(PYTHON) is older or missing."; \
	  echo "Install one and name it: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { \
	  echo "$(PYTHON) lacks the venv module. On Debian and Ubuntu: apt install python3-venv"; exit 1; }
	$(PYTHON) -m venv .venv

.venv/installed: .venv/bin/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable .
	@touch $@

.venv/installed-dev: .venv/bin/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dask,data,dev,expert,video]'
	@touch .venv/installed $@
