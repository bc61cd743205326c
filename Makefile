# Everything goes through ./ares, which prepares the workspace when it must.
# Flags for the flight: make fly FLAGS="--in-process --mission ares_v"

.DEFAULT_GOAL := help
.PHONY: help prepare fly test trials site boundscheck coverage sweep atheris lint format usage lock sbom audit clean

help: ## list the targets
	@echo "make TARGET [FLAGS=...]"
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  \1\t\2/p' Makefile | expand -t 12
	@echo "./ares --help lists the verbs of the command line"

prepare: ## make the workspace ready, nothing else
	@./ares prepare

fly: ## fly the default mission and print the result
	@./ares fly $(FLAGS)

test: ## linters, type checker and every test
	@./ares test $(FLAGS)

site: ## docs and the reference as a site, build/site
	@./ares exec python tools/build_site.py

trials: ## every test, those too of which `make test` runs a sample; an hour
	@./ares exec pytest -m "trial or not trial" --numprocesses=2 --dist=worksteal $(FLAGS)

boundscheck: ## every test with bounds checks in the kernels; compiles them anew
	@rm -rf build/boundscheck
	@NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR="$(CURDIR)/build/boundscheck" ./ares exec \
		pytest -m "trial or not trial" --numprocesses=2 --dist=worksteal --timeout=1800 $(FLAGS)

coverage: ## every test, and which lines none of them runs; twice as slow
	@./ares exec python -m pip install --quiet --no-deps --require-hashes \
		--requirement=requirements/locked/coverage.txt
	@./ares exec pytest -m "trial or not trial" --cov --numprocesses=2 --dist=worksteal $(FLAGS)

sweep: ## every input made from the schemas, everything done with each; an hour
	@./ares exec python -m ares_trials.sweep

TARGET = mission files
atheris: ## coverage-guided hostile input for TARGET="mission files", until interrupted
	@./ares exec python -m pip install --quiet --upgrade --no-deps --require-hashes --target=build/atheris \
		--requirement=requirements/locked/fuzz.txt
	@PYTHONPATH="build/atheris" ./ares exec python benchmarks/fuzz_guided.py "$(TARGET)" $(FLAGS)

lint: ## linters and type checker
	@./ares exec ruff check .
	@./ares exec ruff format --check .
	@./ares exec mypy

format: ## lay out the code
	@./ares exec ruff check --fix .
	@./ares exec ruff format .

usage: ## write what is made of the parameters of the nodes and of the verbs
	@./ares exec python tools/usage.py

lock: ## write the hashes of requirements/*.txt to requirements/locked
	@for name in uv ros-jazzy build fly solve live pages dev coverage fuzz sbom; do ./ares exec uv pip compile --quiet \
		--no-deps --generate-hashes --universal --python-version 3.11 --no-header --no-annotate \
		requirements/$$name.txt --output-file requirements/locked/$$name.txt || exit 1; done

sbom: ## list what is installed, and under which licences: requirements/sbom.json
	@./ares exec python -m pip install --quiet --upgrade --no-deps --require-hashes \
		--target=build/sbom --requirement=requirements/locked/sbom.txt
	@PYTHONPATH=build/sbom .venv/bin/python -m cyclonedx_py environment --no-validate \
		--output-reproducible --output-file=build/sbom.json .venv/bin/python
	@./ares exec python tools/sbom.py build/sbom.json

audit: ## is a pin known to be vulnerable? by the advisories in the folder ARES_ADVISORIES
	@./ares exec python tools/advisories.py

clean: ## remove all that the preparation has made
	rm -rf .venv build install log
