# make demo · make test · make lint · make bench; each builds the virtual environment when it has to. There is one:
# demo takes the lean set (requirements/lean.txt); the others add the tests' tools and the linters to it (dev.txt),
# and change no version in it.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
LEAN := $(VENV)/.lean
INSTALLED := $(VENV)/.installed
PIP := $(BIN)/python -m pip --disable-pip-version-check
# Compiling all of pymavlink's dialects takes longer than the rest; what is imported is compiled then.
LOCKED := install --no-compile --no-deps --require-hashes --only-binary :all: -r

.PHONY: demo test test-sitl lint bench soak lock clean

demo: $(LEAN)
	@echo "== a simulated copter, and MAVProxy with the API; Ctrl-C ends both"
	@$(BIN)/mavproxy-uavapi --simulated --module 'vision:{"source":"sim"}' $(ARGS)

test: $(INSTALLED)
	$(BIN)/python -m pytest -m "not sitl" -n 4 --dist loadfile --no-loadscope-reorder --reruns 2 -rR $(ARGS)

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

# What is there of an older one goes: pip would leave what is no longer asked for.
$(LEAN): requirements/lean.txt setup.py
	@echo "== 1/3 a virtual environment: $(VENV), of $$($(PYTHON) --version)"
	@$(PYTHON) -m venv $(if $(wildcard $(VENV)/pyvenv.cfg),--clear) $(VENV)
	@echo "== 2/3 MAVProxy and what the modules need: requirements/lean.txt, about 150 MB to fetch the first time"
	@$(PIP) $(LOCKED) requirements/lean.txt
	@rm -rf $(VENV)/lib/python3*/site-packages/MAVProxy/modules/mavproxy_cesium  # 114 MB that need tornado to start
	@echo "== 3/3 the modules themselves"
	@$(PIP) install --quiet --no-deps --no-build-isolation -e .
	@touch $@

$(INSTALLED): $(LEAN) requirements/dev.txt
	@echo "== the tests' tools and the linters: requirements/dev.txt"
	@$(PIP) $(LOCKED) requirements/dev.txt
	@touch $@

# The newest versions that go together on Python 3.10 to 3.13, x86_64 and aarch64, after setup.py and lean.in.
COMPILE := UV_PYTHON_DOWNLOADS=never build/lock/bin/uv pip compile --quiet --upgrade --universal --python-version 3.10 \
	--generate-hashes --custom-compile-command "make lock" --excludes requirements/without.in
lock:
	$(PYTHON) -m venv build/lock
	build/lock/bin/python -m pip install --quiet --disable-pip-version-check "uv>=0.13"
	$(COMPILE) -o requirements/lean.txt --extra vision --extra mqtt setup.py requirements/lean.in
	$(COMPILE) -o requirements/dev.txt --extra dev --constraint requirements/lean.txt setup.py requirements/lean.in

soak: $(INSTALLED)
	$(BIN)/python benchmarks/soak.py --minutes $(or $(MINUTES),10)
	$(BIN)/python benchmarks/soak_strangers.py --minutes $(or $(MINUTES),10)

clean:
	rm -rf $(VENV) build dist *.egg-info
