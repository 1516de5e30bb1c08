# The only targets; each is one line of what a developer would type in .venv.
.PHONY: setup live demo up test test-all check openapi sbom benchmark lock
VENV := .venv
BIN := $(VENV)/bin
UV := $(shell command -v uv 2>/dev/null)
# A system is a dozen processes: each would compile anew all that it imports.
unexport PYTHONDONTWRITEBYTECODE
CORES := $(shell getconf _NPROCESSORS_ONLN)
# Beside the kernels, where numba keeps what it compiles: an environment may outlive its checkout.
COMPILED := skyway/planner/kernels/__pycache__/.compiled
PYTEST := $(BIN)/python -m pytest --maxprocesses 5 --no-loadscope-reorder

setup: $(COMPILED)

$(VENV)/.ready: requirements.txt pyproject.toml
	@UV="$(UV)" VENV="$(VENV)" sh tools/setup.sh
	@touch $@

$(COMPILED): $(VENV)/.ready $(wildcard skyway/planner/kernels/*.py)
	@echo "Compiling the planner, once: about a minute."
	@$(BIN)/python -m skyway.planner.warm
	@$(BIN)/python -m skyway.dispatch.warm
	@mkdir -p $(@D)
	@touch $@

live: setup
	@$(BIN)/skyway up --demo

demo: setup
	@$(BIN)/skyway demo

up: setup
	@$(BIN)/skyway up

# What a person waits for. Whole systems mostly wait, so there are more workers than cores: two wait
# while others compute. What runs where: tests/lanes.py.
test: setup
	@$(PYTEST) -n $$(($(CORES) + 2)) -m "not long"

# The same, and then the tests with the mark `long`.
test-all: test
	@$(PYTEST) -n $$(($(CORES) + 3)) -m long

# Without brokers, databases (SQLite too) and whole systems. The import rules are among these tests.
check: setup
	@$(BIN)/ruff format --check .
	@$(BIN)/ruff check .
	@$(BIN)/mypy
	@$(PYTEST) -n $(CORES) -m "not sql and not integration and not end_to_end and not long"

openapi: setup
	@$(BIN)/python tools/write_openapi.py

sbom:
	@uvx -q --from cyclonedx-bom cyclonedx-py requirements requirements.txt -o sbom.json

benchmark: setup $(VENV)/.peers
	@$(BIN)/python -m benchmarks

$(VENV)/.peers: requirements-peers.txt $(VENV)/.ready
	@UV="$(UV)" VENV="$(VENV)" sh tools/install_peers.sh

lock:
	uv pip compile --universal --generate-hashes --no-emit-index-url --no-header \
		--python-version 3.11 --extra dev pyproject.toml -o requirements.txt
	uv pip compile --universal --generate-hashes --no-emit-index-url --no-header \
		--python-version 3.11 --extra image -c requirements.txt pyproject.toml -o requirements-image.txt
	uv pip compile --universal --generate-hashes --no-emit-index-url --no-header \
		--python-version 3.11 --extra peers -c requirements.txt pyproject.toml -o requirements-peers.txt
	uv pip compile --universal --generate-hashes --no-emit-index-url --no-header \
		--python-version 3.11 --extra chart -c requirements.txt pyproject.toml -o requirements-chart.txt
	uv pip compile --universal --generate-hashes --no-emit-index-url --no-header \
		--python-version 3.11 --extra ray -c requirements.txt pyproject.toml -o requirements-ray.txt
