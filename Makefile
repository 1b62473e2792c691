# `make help` lists the targets. Each builds the virtual environment when it has to. There is one: demo takes the lean
# set (requirements/lean.txt); the others add the tests' tools and the linters to it (dev.txt), and change no version.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
LEAN := $(VENV)/.lean
MODULES := $(VENV)/.modules
INSTALLED := $(VENV)/.installed
COMPILED := $(VENV)/.compiled
LINTERS := node_modules/.package-lock.json
# ESLint asks for this Node.js; users of the page need none.
NODE := node -e '[a, b] = process.versions.node.split("."); process.exit(a > 20 || (a == 20 && b >= 19) ? 0 : 1)' 2>/dev/null
PIP := $(BIN)/python -m pip --disable-pip-version-check
# Compiling all of pymavlink's dialects takes longer than the rest; what is imported is compiled then.
LOCKED := install --no-compile --no-deps --require-hashes --only-binary :all: -r

# Container images often set it; then each of some hundred processes of the tests would compile MAVProxy anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: docs wheels bundle demo demo-fleet test test-all test-sitl test-lowest lint lint-js format bench soak lock clean help

demo: $(MODULES)  ## fly a simulated copter: MAVProxy with uavapi and vision; ARGS go to mavproxy-uavapi
	@echo "== a simulated copter, and MAVProxy with the API; Ctrl-C ends both"
	@$(BIN)/mavproxy-uavapi --simulated --module 'vision:{"source":"sim"}' $(ARGS)

demo-fleet: $(INSTALLED)  ## a broker, a database, a station of two workers and VEHICLES (100) vehicles on paper
	@$(BIN)/python benchmarks/demo_fleet.py --vehicles $(or $(VEHICLES),100)

test: $(COMPILED)  ## run the tests but the long ones; ARGS="-k name" picks some, LONG=7 adds a tenth of the long ones
	$(BIN)/python -m pytest -m "not sitl" --long=$(or $(LONG),none) -n 6 --dist loadfile --no-loadscope-reorder $(ARGS)

test-all: $(INSTALLED)  ## run the tests that take long, too
	$(BIN)/python -m pytest -m "not sitl" -n 2 --dist loadfile --no-loadscope-reorder $(ARGS)

test-sitl: $(INSTALLED)  ## run the tests that need ArduPilot's SITL, built in ARDUPILOT_HOME
	@test -n "$(ARDUPILOT_HOME)" || { echo "set ARDUPILOT_HOME to a built copy of ArduPilot"; exit 2; }
	ARDUPILOT_HOME=$(ARDUPILOT_HOME) $(BIN)/python -m pytest -m sitl -o faulthandler_timeout=1800 $(ARGS)

lint: $(INSTALLED)  ## check style and types: ruff, mypy; where Node.js is ESLint and tsc, too
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	@if $(NODE) && $(MAKE) --no-print-directory $(LINTERS); then $(MAKE) --no-print-directory lint-js; \
		else echo "== JavaScript is not checked: no Node.js 20.19, or npm cannot fetch the linters"; fi

lint-js: $(LINTERS)  ## check the page's JavaScript: ESLint, tsc
	node_modules/.bin/eslint .
	node_modules/.bin/tsc

format: $(INSTALLED)  ## mend what ruff can mend, then lay out the code; ESLint's where Node.js is
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	@if $(NODE); then $(MAKE) --no-print-directory $(LINTERS) && node_modules/.bin/eslint --fix .; fi

bench: $(INSTALLED)  ## run the benchmarks that need no SITL
	for benchmark in $(filter-out %_sitl.py,$(wildcard benchmarks/bench_*.py)); do $(BIN)/python $$benchmark || exit 1; done

# Else each worker compiles all tests in its first run. Two processes, because the smallest machines have two cores.
$(COMPILED): $(INSTALLED)
	@echo "== the tests are compiled"
	@for half in "core rules gradys" "uavapi vision end_to_end"; do \
		$(BIN)/python -m pytest --collect-only -qq $$(printf 'tests/%s ' $$half) > /dev/null & \
	done; wait
	@touch $@

# What is there of an older one goes: pip would leave what is no longer asked for.
$(LEAN): requirements/lean.txt
	@echo "== 1/3 a virtual environment: $(VENV), of $$($(PYTHON) --version)"
	@$(PYTHON) -m venv $(if $(wildcard $(VENV)/pyvenv.cfg),--clear) $(VENV)
	@echo "== 2/3 MAVProxy and what the modules need: requirements/lean.txt, about 150 MB to fetch the first time"
	@$(PIP) $(LOCKED) requirements/lean.txt
	@rm -rf $(VENV)/lib/python3*/site-packages/MAVProxy/modules/mavproxy_cesium  # 114 MB that need tornado to start
	@touch $@

$(MODULES): $(LEAN) pyproject.toml setup.py
	@echo "== 3/3 the modules themselves"
	@$(PIP) install --quiet --no-deps --no-build-isolation -e .
	@touch $@

$(INSTALLED): $(MODULES) requirements/dev.txt
	@echo "== the tests' tools and the linters: requirements/dev.txt"
	@$(PIP) $(LOCKED) requirements/dev.txt
	@touch $@

$(LINTERS): package-lock.json
	npm ci --no-audit --no-fund
	@touch $@

wheels: $(INSTALLED)  ## make dist/*.whl and *.tar.gz: the modules, and what takes uav-api's place (docs/gradys.md)
	$(BIN)/python packaging/distributions.py

# Its pages are copies: Sphinx checks each link and heading, and what it warns of ends it.
docs: $(MODULES)  ## build these pages as a site with a search: build/manual, and as manual.zip; it asks for Python 3.11
	@$(PIP) $(LOCKED) requirements/docs.txt
	@mkdir -p build/manual-pages
	$(BIN)/sphinx-build -q -W --keep-going -c packaging/manual -d build/manual-doctrees build/manual-pages build/manual
	$(BIN)/python -c "import shutil; shutil.make_archive('build/manual', 'zip', 'build', 'manual')"

bundle:  ## make dist/*.pex, one file of everything for a machine without a network; ARGS="--python 3.13 --machine aarch64"
	$(PYTHON) -m venv build/bundler
	build/bundler/bin/python -m pip install --quiet --disable-pip-version-check "pex>=2.105" packaging
	build/bundler/bin/python packaging/bundle.py $(ARGS)

# The newest versions that go together on Python 3.10 to 3.14, x86_64 and aarch64, after pyproject.toml and lean.in.
UV := build/lock/bin/uv
COMPILE := UV_PYTHON_DOWNLOADS=never $(UV) pip compile --quiet --upgrade --universal --python-version 3.10 \
	--generate-hashes --custom-compile-command "make lock" --excludes requirements/without.in
$(UV):
	$(PYTHON) -m venv build/lock
	build/lock/bin/python -m pip install --quiet --disable-pip-version-check "uv>=0.13"

lock: $(UV)  ## renew the locked versions in requirements/
	$(COMPILE) -o requirements/lean.txt --extra vision --extra mqtt pyproject.toml requirements/lean.in
	$(COMPILE) -o requirements/dev.txt --extra dev --constraint requirements/lean.txt pyproject.toml requirements/lean.in
	$(subst 3.10,3.11,$(COMPILE)) -o requirements/docs.txt --constraint requirements/lean.txt --constraint requirements/dev.txt \
		requirements/docs.in

# pyproject.toml asks for no more than what this shows to be enough.
test-lowest: $(UV)  ## run the tests of the parts on the lowest versions that pyproject.toml allows
	$(UV) pip compile --quiet --resolution lowest-direct --python $(PYTHON) --extra test --excludes requirements/without.in \
		-o build/lowest.txt pyproject.toml requirements/lean.in
	$(UV) venv --quiet --clear --python $(PYTHON) build/lowest
	$(UV) pip sync --quiet --python build/lowest build/lowest.txt
	build/lowest/bin/python -m pytest -m "not sitl" --long=none -n 2 --dist loadfile $(or $(ARGS),tests/core tests/gradys tests/uavapi tests/vision)

soak: $(INSTALLED)  ## run random clients and faults for MINUTES (10); nothing may be left over
	$(BIN)/python benchmarks/soak.py --minutes $(or $(MINUTES),10)
	$(BIN)/python benchmarks/soak_strangers.py --minutes $(or $(MINUTES),10)

clean:  ## remove the virtual environment and what was built
	rm -rf $(VENV) node_modules build dist *.egg-info

help:  ## list the targets
	@sed -n 's/^\([a-z-]*\):.*  ## /\1\t/p' $(MAKEFILE_LIST) | expand -t 12
