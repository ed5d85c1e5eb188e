# The two commands of the README: make demo, make test. Everything they need is set up in .venv.
PYTHON ?= python3
CORES ?= 2
SEEDS ?= 1 2 3
POLAR_SIM_ROOT ?= ../shared/polar-sim
BIN := .venv/bin
RUN := $(BIN)/polarsim run --cores $(CORES)

.PHONY: help setup demo rover release accuracy test pytest cluster chaos fuzz lint docs picture clean lock schema columns
.DEFAULT_GOAL := help

help: ## list what can be made
	@grep -E '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## (.*)/make \1\t\2/' | expand -t 16

setup: .venv/.ready ## make .venv with polarsim, snakemake and all they need

.venv/.ready: requirements.lock pyproject.toml workflow/setup.sh
	bash workflow/setup.sh $(PYTHON)
	@touch $@

demo: setup ## the whole pipeline on the analog sandbox: config/config.yaml
	$(RUN)
	@$(BIN)/polarsim report demo --cores $(CORES)
	@echo "to look at it in the browser: $(BIN)/polarsim explore demo"

ROVER := rover_autonomy --configfile config/overlays/rover.yaml

rover: setup ## a rover that finds its own way over the demo's terrains: config/overlays/rover_autonomy.yaml
	$(RUN) $(ROVER) --configfile config/overlays/rover_autonomy.yaml
	@$(BIN)/snakemake $(ROVER) config/overlays/rover_autonomy.yaml --quiet all --report results/demo/rover_autonomy.html
	@echo "page: results/demo/rover_autonomy.html"
	@echo "table: results/demo/tables/rover_autonomy.md, figure: results/demo/figures/rover_autonomy.png"

release: setup ## cameras, labels, twins and tables on the published labels and meshes (POLAR_SIM_ROOT)
	POLAR_SIM_ROOT=$(POLAR_SIM_ROOT) $(RUN) --configfile config/release.yaml
	@POLAR_SIM_ROOT=$(POLAR_SIM_ROOT) $(BIN)/polarsim report release --cores $(CORES)

accuracy: setup ## poses, rocks and meshes against the truth of three analog sandboxes: config/accuracy.yaml
	for seed in $(SEEDS); do \
	  $(RUN) geometry --configfile config/accuracy.yaml --config run=accuracy$$seed \
	    --config "source={kind: analog, root: data/analog$$seed}" --config "analog={seed: $$seed}" || exit; \
	done
	@$(BIN)/polarsim compare $(SEEDS:%=accuracy%) --out results/accuracy

test: setup ## lint, formats, types, dry-runs and tests
	@$(MAKE) --no-print-directory -j 2 lint pytest

pytest: setup # workers share the cores, so each has one thread
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n $(CORES) --dist worksteal --durations=20 --basetemp .pytest

cluster: setup ## the workflow on a real SLURM of one node that is started here (root, apt-get install slurm-wlm munge)
	$(BIN)/python -m pytest -m cluster tests/cluster --basetemp .pytest

MOMENTS ?= 20
chaos: setup ## kill small runs at random moments (MOMENTS of each kind), hours: the same command ends each
	$(BIN)/python -m benchmarks.chaos --moments $(MOMENTS)

fuzz: setup ## 10,000 damaged files for every reader, an hour
	FUZZ_EXAMPLES=10000 $(BIN)/python -m pytest -n $(CORES) tests/formats/test_hostile_files.py

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/snakefmt --check Snakefile workflow/Snakefile workflow/rules
	$(BIN)/mypy

docs: setup ## the manual as a site, build/site/index.html
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs build/site

picture: setup ## the README's picture from a finished demo, docs/comparison.jpg
	$(BIN)/python docs/readme_picture.py results/demo/figures/strip docs/comparison.jpg

clean: ## remove results, the site, and what the analog generated
	rm -rf results/demo results/release results/accuracy* data/analog* build/site .snakemake .pytest

schema: setup ## write config/schema.json and config/views.schema.json anew
	$(BIN)/polarsim schema > config/schema.json
	$(BIN)/polarsim schema --views > config/views.schema.json

columns: setup ## write the columns of tables into docs/tables.md and docs/formats.md
	$(BIN)/python -m polarsim.schemas docs/tables.md docs/formats.md

# Needs uv (pip install uv), and a CPU build of torch where uv looks for packages (UV_FIND_LINKS): with another one the
# lock would pin CUDA's packages. The local version of that build is cut off again, so that one lock serves all machines.
lock: ## make requirements.lock anew from pyproject.toml
	sed -i 's/^torch==[0-9.]*$$/&+cpu/' requirements.lock
	uv pip compile pyproject.toml --extra detect --extra rover --extra publish --extra cluster --extra dev --no-annotate --no-header -o requirements.lock
	sed -i 's/^\(torch==[0-9.]*\)+.*$$/\1/' requirements.lock
