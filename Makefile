# Everything runs in .venv, which the first target that needs it makes. Needs Python 3.11 or 3.12 and make.
.DEFAULT_GOAL := help
.PHONY: help install page demo test serve bench torture load lint openapi settings protos nets checkers examples image smoke screenshots clean

BIN := .venv/bin
PYTHON := $(BIN)/python
STAMP := .venv/.installed
# One thread per process: runs are parallel, not the small matrices within one.
export OMP_NUM_THREADS := 1
# Tried by running it: a pyenv shim may exist without its version.
FIND_PYTHON := for p in python3.11 python3.12 python3; do \
	"$$p" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 13))' 2>/dev/null && echo "$$p" && break; done

help: ## list the targets
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' Makefile | expand -t 10

install: $(STAMP) ## make .venv with the pinned versions

# pip would compile on one core. A few files of packages are for other versions of Python, and fail to compile.
$(STAMP): pyproject.toml constraints.txt
	@python=$$($(FIND_PYTHON)); \
	if [ -z "$$python" ]; then echo "make: found neither python3.11 nor python3.12; install one of them" >&2; exit 1; fi; \
	test -x $(PYTHON) || "$$python" -m venv .venv
	$(PYTHON) -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt -e ".[dev,export]"
	@echo "compiling, once: else it would be a part of the first searches' processor time"; set -e; \
	$(PYTHON) -m compileall -qq -j 0 -x '/tests?/' .venv/lib & \
	folder=$$(mktemp -d); trap 'rm -r "$$folder"' EXIT; \
	for run in "low --method archive --episodes 60" "mixed --method risk-sac --episodes 15"; do \
		$(PYTHON) -m risk_sac run --scenario $$run --seed 1 --out "$$folder/$${run%% *}" > /dev/null; done; wait
	@touch $@

page: $(STAMP) ## build the web page anew, after a change of its sources
	$(PYTHON) -m pip install --quiet --disable-pip-version-check --no-deps -e .

demo: $(STAMP) ## start the service, run a campaign over REST, write results/demo.json; KEEP=1 goes on serving its page
	$(PYTHON) -m service.demo $(if $(KEEP),--keep)

# Checkers of the exports, whose pins are none of ours: numpy before 2, lxml before 6. One is compiled as it is installed.
CHECKERS := .venv/checkers/.installed

$(CHECKERS): tests/exports/checkers.txt | $(STAMP)
	$(PYTHON) -m venv .venv/checkers
	if .venv/checkers/bin/python -m pip install --quiet --disable-pip-version-check -r $<; then touch $@; \
		else echo "the checkers of exports cannot be installed here; what needs them is left out of the tests" >&2; fi

checkers: $(CHECKERS) ## make .venv/checkers: ASAM's checkers and CommonRoad's, which the tests put exports before

examples: $(STAMP) ## write tests/exports/examples: one example for each export format
	$(PYTHON) -m tests.exports.make_examples

# By file: two processes would each make what the tests of a file share. In order: the long ones come first. By four
# processes, on two cores too: half of the time tests wait for servers.
test: lint $(CHECKERS) ## check the code and run the whole suite
	$(PYTHON) -m pytest -n 4 --dist loadscope --no-loadscope-reorder

serve: $(STAMP) ## run the service on RISK_SAC_HOST and RISK_SAC_PORT; by default its page is at http://127.0.0.1:8000/page/
	$(PYTHON) -m service

bench: $(STAMP) ## measure speed as ratios
	$(PYTHON) -m pytest -m bench -s tests/benchmarks/bench_*.py

# What is marked `torture`, and what the suite does in part.
torture: $(STAMP) ## kill, fill, damage and fuzz the service in earnest, about two hours
	$(PYTHON) -m pytest -m torture --timeout 7200 tests/acceptance tests/integration tests/unit tests/web
	RISK_SAC_TORTURE=full RISK_SAC_SCHEMATHESIS_CASES=20000 $(PYTHON) -m pytest -m "not bench" --timeout 7200 \
		tests/torture tests/contract/test_fuzzing.py
	for times in "worker --times 30" "raylet --times 10" "head --times 5" "server --times 10"; do \
		$(PYTHON) -m tests.torture.ray_numbers --of $$times || exit 1; done

load: $(STAMP) ## poll and follow the service while it searches, and fill its database; half an hour on a quiet machine
	$(PYTHON) -m tests.load.run

lint: $(STAMP) ## style, types and import rules
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

openapi: $(STAMP) ## write openapi.yaml
	$(PYTHON) -m service.openapi

settings: $(STAMP) ## write the table of settings into service/settings.md
	$(PYTHON) -m service.settings

protos: $(STAMP) ## generate risk_sac/egos/remote/*_pb2.py
	$(PYTHON) -m grpc_tools.protoc -I. --python_out=. risk_sac/egos/remote/*.proto

nets: $(STAMP) ## rebuild sumo_nets/*/*.net.xml
	PATH="$(CURDIR)/$(BIN):$$PATH" sumo_nets/build.sh

image: ## build the container image localhost/risk-sac with docker
	docker build --file docker/Dockerfile --tag localhost/risk-sac --build-arg REVISION=$$(git rev-parse HEAD) \
		$(if $(TORCH_INDEX_URL),--build-arg TORCH_INDEX_URL=$(TORCH_INDEX_URL)) .

smoke: $(STAMP) ## build the image, run it, and say in one line whether it works
	$(PYTHON) docker/smoke

screenshots: $(STAMP) ## draw every screen of the page, with a Chromium; the replay is the picture of README.md
	$(PYTHON) -m tests.web.screenshots

clean: ## remove .venv, caches and builds; data/ and results/ stay
	rm -rf .venv build dist service/web/dist service/web/node_modules *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .benchmarks .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
