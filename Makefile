# Main targets: make demo, make test, make test-all. Dependencies are installed in .venv: `setup` for the demo, `dev` for all else.
PYTHON ?= python3
CORES ?= 2
SEEDS ?= 1 2 3
POLAR_SIM_ROOT ?= ../shared/polar-sim
BIN := .venv/bin
RUN := $(BIN)/polarsim run --cores $(CORES)

.PHONY: help setup dev demo rover release accuracy test test-all pytest cluster chaos fuzz lint docs picture clean durations lock schema columns
.DEFAULT_GOAL := help

help: ## list the targets
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/make \1\t\2/' | expand -t 16

setup: .venv/.ready ## create .venv with what the workflow needs: extras pipeline, detect and cluster

.venv/.ready: requirements.lock pyproject.toml workflow/setup.sh
	bash workflow/setup.sh $(PYTHON)
	@touch $@

dev: .venv/.dev ## add what rover, publishing, tests and manual need to .venv: all extras

.venv/.dev: .venv/.ready requirements-dev.lock
	bash workflow/setup.sh $(PYTHON) requirements-dev.lock
	@touch $@

demo: setup ## run the pipeline on the analog sandbox: config/config.yaml
	@$(RUN)

ROVER := rover_autonomy --configfile config/overlays/rover.yaml

rover: dev ## autonomous drives over terrains of the demo: config/overlays/rover_autonomy.yaml
	$(RUN) $(ROVER) --configfile config/overlays/rover_autonomy.yaml
	@$(BIN)/snakemake $(ROVER) config/overlays/rover_autonomy.yaml --quiet all --report results/demo/rover_autonomy.html
	@echo "page: results/demo/rover_autonomy.html"
	@echo "table: results/demo/tables/rover_autonomy.md, figure: results/demo/figures/rover_autonomy.png"

release: setup ## cameras, labels, twins and tables on the published labels and meshes (POLAR_SIM_ROOT)
	@POLAR_SIM_ROOT=$(POLAR_SIM_ROOT) $(RUN) --configfile config/release.yaml

accuracy: setup ## accuracy of poses, rocks and meshes on three analog sandboxes: config/accuracy.yaml
	for seed in $(SEEDS); do \
	  $(RUN) geometry --configfile config/accuracy.yaml --config run=accuracy$$seed \
	    --config "source={kind: analog, root: data/analog$$seed}" --config "analog={seed: $$seed}" || exit; \
	done
	@$(BIN)/polarsim compare $(SEEDS:%=accuracy%) --out results/accuracy

SELECTED ?= not slow
test: dev ## lint, formats, types, dry-runs and all tests that are not slow
	@$(MAKE) --no-print-directory -j 2 lint pytest

test-all: ## the same and slow tests: small runs, trainings, faults, the manual; as in CI
	@$(MAKE) --no-print-directory test SELECTED=

# One thread per worker; bytecode, because many processes import the same modules; -rs: reasons of skipped tests.
pytest: dev
	OMP_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -m "$(SELECTED)" -n $(CORES) --dist worksteal --durations=20 -rs --basetemp .pytest

cluster: dev ## run the workflow on a local SLURM of one node (root, apt-get install slurm-wlm munge)
	$(BIN)/python -m pytest -m cluster tests/cluster --basetemp .pytest

MOMENTS ?= 20
chaos: dev ## kill small runs at random times and resume them (MOMENTS per kind; takes hours)
	$(BIN)/python -m benchmarks.chaos --moments $(MOMENTS)

fuzz: dev ## test every reader with 10,000 damaged files (one hour)
	FUZZ_EXAMPLES=10000 $(BIN)/python -m pytest -n $(CORES) tests/formats/test_hostile_files.py

lint: dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/snakefmt --check Snakefile workflow/Snakefile workflow/rules
	$(BIN)/mypy

docs: dev ## build the manual: build/site/index.html
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs build/site

picture: setup ## update the image of the README from a complete demo: docs/comparison.jpg
	$(BIN)/python docs/readme_picture.py results/demo/figures/strip docs/comparison.jpg

clean: ## remove results, manual and generated data
	rm -rf results/demo results/release results/accuracy* data/analog* build/site .snakemake .pytest

schema: setup ## update config/schema.json, workflow/schemas/config.schema.yaml and config/views.schema.json
	$(BIN)/polarsim schema > config/schema.json
	$(BIN)/python -m polarsim.running.catalogue_schema > workflow/schemas/config.schema.yaml
	$(BIN)/polarsim schema --views > config/views.schema.json

columns: setup ## update the columns of tables in docs/tables.md and docs/formats.md
	$(BIN)/python -m polarsim.schemas docs/tables.md docs/formats.md

durations: setup ## update the expected durations of jobs from a complete demo: polarsim/running/durations.json
	$(BIN)/python -m polarsim.running.durations results/demo

# Requires uv (pip install uv) and a CPU build of torch in UV_FIND_LINKS; otherwise the locks would pin CUDA packages. The
# local version of this build is removed, so that the locks are valid on all machines. All of requirements.lock is in
# requirements-dev.lock. uv drops markers: Taichi and backports-zstd have no wheels for Python 3.14.
LOCKS := requirements.lock requirements-dev.lock
WORKFLOW := --extra pipeline --extra detect --extra cluster
lock: ## update requirements.lock and requirements-dev.lock from pyproject.toml
	sed -i 's/^torch==[0-9.]*$$/&+cpu/' $(LOCKS)
	uv pip compile pyproject.toml $(WORKFLOW) --extra taichi --extra rover --extra publish --extra las --extra dev --no-annotate --no-header -o requirements-dev.lock
	uv pip compile pyproject.toml $(WORKFLOW) -c requirements-dev.lock --no-annotate --no-header -o requirements.lock
	sed -i -E -e 's/^(torch==[0-9.]*)[+].*$$/\1/' -e 's/^(taichi|backports-zstd)==[0-9.]*$$/& ; python_version < "3.14"/' $(LOCKS)
