# make demo · make test · make lint · make bench; each builds the virtual environment when it has to.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed

.PHONY: demo test test-sitl lint bench soak clean

demo: $(INSTALLED)
	$(BIN)/mavproxy-uavapi --simulated --module 'vision:{"source":"sim"}' $(ARGS)

test: $(INSTALLED)
	$(BIN)/python -m pytest -m "not sitl" -n 4 --dist loadfile --reruns 2 -rR $(ARGS)

# Against ArduPilot's own simulation: make test-sitl ARDUPILOT_HOME=…
test-sitl: $(INSTALLED)
	@test -n "$(ARDUPILOT_HOME)" || { echo "set ARDUPILOT_HOME to a built copy of ArduPilot"; exit 2; }
	ARDUPILOT_HOME=$(ARDUPILOT_HOME) $(BIN)/python -m pytest -m sitl $(ARGS)

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(INSTALLED)
	for benchmark in $(filter-out %_sitl.py,$(wildcard benchmarks/bench_*.py)); do $(BIN)/python $$benchmark || exit 1; done

$(INSTALLED): setup.py pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[dev]"
	touch $@

soak: $(INSTALLED)
	$(BIN)/python benchmarks/soak.py --minutes $(or $(MINUTES),10)
	$(BIN)/python benchmarks/soak_strangers.py --minutes $(or $(MINUTES),10)

clean:
	rm -rf $(VENV) build dist *.egg-info
