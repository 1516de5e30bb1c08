# The only targets; each is one line of what a developer would type in .venv.
.PHONY: setup live demo up test test-all check openapi sbom benchmark lock
VENV := .venv
export VENV
BIN := $(VENV)/bin
LOCK := --universal --generate-hashes --no-emit-index-url --no-header --python-version 3.11
# A system is a dozen processes: each would compile anew all that it imports.
unexport PYTHONDONTWRITEBYTECODE
CORES := $(shell getconf _NPROCESSORS_ONLN)
# Beside the kernels, where numba keeps what it compiles: an environment may outlive its checkout.
COMPILED := skyway/planner/kernels/__pycache__/.compiled
PYTEST := $(BIN)/python -m pytest --maxprocesses 5 --no-loadscope-reorder

setup: $(VENV)/.developers $(COMPILED)

# What runs Skyway; and what its developers need too.
$(VENV)/.ready: requirements-run.txt requirements-uv.txt pyproject.toml
	@sh tools/setup.sh
	@touch $@

$(VENV)/.developers: requirements.txt $(VENV)/.ready
	@sh tools/setup.sh developers
	@touch $@

$(COMPILED): $(VENV)/.ready $(wildcard skyway/planner/kernels/*.py)
	@sh tools/step.sh 4/4 "Compiling the planner, once, for up to a minute" sh -c \
		'$(BIN)/python -m skyway.dispatch.warm & trap "kill $$! 2>/dev/null" EXIT; trap "exit 130" INT TERM; \
		$(BIN)/python -m skyway.planner.warm && wait $$!'
	@mkdir -p $(@D)
	@touch $@

live: $(COMPILED)
	@$(BIN)/skyway up --demo

demo: $(COMPILED)
	@$(BIN)/skyway demo

up: $(COMPILED)
	@$(BIN)/skyway up

# What a person waits for. Whole systems mostly wait, so there are more workers than cores: two wait
# while others compute. What runs where: tests/lanes.py.
test: setup
	@$(PYTEST) -n $$(($(CORES) + 2)) -m "not long"

# The same, and then the tests with the mark `long`.
test-all: test
	@$(PYTEST) -n $$(($(CORES) + 3)) -m long

# Without brokers, databases (SQLite too) and whole systems. The import rules are among these tests.
# mypy uses one processor, so it runs beside the tests.
check: setup
	@$(BIN)/ruff format --check .
	@$(BIN)/ruff check .
	@sh -c '$(BIN)/mypy & trap "kill $$! 2>/dev/null" EXIT; trap "exit 130" INT TERM; \
		$(PYTEST) -n $(CORES) -m "not sql and not integration and not end_to_end and not long" && \
		{ wait $$! || { echo "mypy found errors: see above" >&2; exit 1; }; }'

openapi: setup
	@$(BIN)/python tools/write_openapi.py

sbom:
	@uvx -q --from cyclonedx-bom cyclonedx-py requirements requirements.txt -o sbom.json

benchmark: $(VENV)/.peers $(COMPILED)
	@$(BIN)/python -m skyway_lab

$(VENV)/.peers: requirements-peers.txt $(VENV)/.developers
	@sh tools/install.sh -r requirements-peers.txt && touch $@ || \
		echo "The peers could not be installed; benchmarking without them." >&2

lock:
	uv pip compile $(LOCK) --extra dev pyproject.toml -o requirements.txt
	for set in run image peers chart ray; do uv pip compile $(LOCK) -c requirements.txt \
		--extra $$set pyproject.toml -o requirements-$$set.txt || exit 1; done
	echo uv | uv pip compile $(LOCK) --no-annotate - -o requirements-uv.txt
