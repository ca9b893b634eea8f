# `make sitl` and `make test` do all the set-up on a fresh Debian machine with Python 3.11.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
# On a terminal pip shows what it fetches.
INSTALL := $(PIP) install $(if $(MAKE_TERMOUT),,-qq) -c constraints.txt
STAMPS := $(VENV)/.stamps

# The tests start hundreds of processes, of which none shall compile the package anew.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help sitl test test-thorough lint unit mutants firmware firmware-sim wheelhouse check-lowest docs clean

help:
	@echo "make sitl   keep a station for 60 s with the simulated boat"
	@echo "make test   lint, types and all tests"
	@echo "make test-thorough  further cases of what the tests show, and long ones: before a release"
	@echo "make mutants  change what guards the motors, one thing at a time, and count which changes its tests notice"
	@echo "make firmware  build the anemometer's firmware for Arduino Uno and Nano"
	@echo "make firmware-sim  the same, and a simulated Arduino to run it on"
	@echo "make wheelhouse  a folder that installs the daemon without a network (MACHINE=aarch64 FOR=3.11)"
	@echo "make check-lowest  run with the lowest versions of the packages that pyproject.toml allows"
	@echo "make docs   the documentation as a site: build/site/index.html"
	@echo "make clean  remove the virtual environment and caches"

# What the environment is made with. TORCH_INDEX: the address of an index that has CPU builds of torch; without it an
# x86-64 machine gets the default build, which brings 4 GB of CUDA.
TORCH_INDEX ?=
TOO_OLD = import sys; v = sys.version_info; sys.exit(v < (3, 11) and \
	f"asvhil needs Python 3.11 or newer, and $(PYTHON) is {v.major}.{v.minor}: make PYTHON=python3.11 $(MAKECMDGOALS)")
NO_VENV = $(PYTHON) cannot make an environment: install python3-venv (Debian: apt install python3-venv), then make again

# The daemon's own packages, and the Lua interpreter of the simulated autopilot: no torch. An environment that an earlier
# make could not finish, or that is of another Python, is made anew.
$(STAMPS)/base: pyproject.toml constraints.txt
	@echo "setting up $(VENV): some 650 MB, a minute or two ..."
	@$(PYTHON) -c '$(TOO_OLD)'
	@$(PYTHON) -c 'import ensurepip, venv' 2> /dev/null || { echo "$(NO_VENV)" >&2; exit 1; }
	@test -f $@ && $(BIN)/python -c '$(TOO_OLD)' || $(PYTHON) -m venv --clear $(VENV)
	@$(INSTALL) -e '.[sim]'
	@mkdir -p $(STAMPS) && touch $@

# Of what the tests need a small part is imported, and compiled when it is.
$(STAMPS)/test: $(STAMPS)/base
	@echo "adding what the tests need: up to 6 GB, several minutes ..."
	@$(INSTALL) --no-compile $(if $(TORCH_INDEX),--extra-index-url $(TORCH_INDEX)) -e '.[train,dev]'
	@touch $@

# The package that the paper's first solver came from asks for an old NumPy, which it does not need.
$(STAMPS)/peer: $(STAMPS)/test constraints-peer.txt
	@echo "adding the peer of the torch solver ..."
	@$(PIP) install -qq --no-deps -r constraints-peer.txt
	@touch $@

# MAVProxy wants a desktop's worth of packages; headless it needs none of them.
$(STAMPS)/mavproxy: $(STAMPS)/base constraints-mavproxy.txt
	@echo "adding MAVProxy as a peer ..."
	@$(PYTHON) -m venv --clear --without-pip .venv-mavproxy
	@$(PIP) --python .venv-mavproxy/bin/python install --no-compile -qq --no-deps -r constraints-mavproxy.txt
	@touch $@

sitl: $(STAMPS)/base
	@$(BIN)/asvhil sitl
	@command -v asvhil > /dev/null || echo "next: . $(BIN)/activate   puts the command asvhil on the PATH of this terminal"

# Lint and types take one core for a minute: beside the tests, and told after them.
test: $(STAMPS)/base
	@$(MAKE) -s -j2 $(STAMPS)/peer $(STAMPS)/mavproxy
	@nice -n 5 $(MAKE) -s lint > $(VENV)/lint.txt 2>&1 & beside=$$!; \
	$(MAKE) -s unit; tests=$$?; \
	wait $$beside; lint=$$?; echo "lint and types:"; cat $(VENV)/lint.txt; \
	test $$tests -eq 0 -a $$lint -eq 0

lint: $(STAMPS)/test
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy

# Debian's compiler and Arduino core are installed first where this user may.
firmware:
	@firmware/install-tools.sh
	@$(MAKE) -s -C firmware/arduino_anemometer

firmware-sim: firmware
	@$(MAKE) -s -C tests/firmware/harness
	@$(MAKE) -s -C tests/firmware/host

# Without the tools of the firmware and of the page their tests are skipped, and say so; where CI is set they fail.
# Meanwhile the tests are compiled, once, before the processes that need them would all do so.
# Tests in virtual time share all cores, and give way to those in real time, which run beside them, three at a time: they
# mostly wait. Only the files that have some are read for these.
REAL_TIME := grep -rl --include='test_*.py' 'mark.real_time' tests
unit: $(STAMPS)/test $(STAMPS)/peer $(STAMPS)/mavproxy
	@$(BIN)/pytest -q --collect-only tests/unit > /dev/null 2>&1 & units=$$!; \
	$(BIN)/pytest -q --collect-only --ignore=tests/unit > /dev/null 2>&1 & others=$$!; \
	tools=0; $(MAKE) -s firmware-sim || tools=1; tests/page/install-tools.sh || tools=1; \
	wait $$units $$others; test $$tools -eq 0 -o -z "$$CI"
	@$(BIN)/pytest -q -n 3 --dist worksteal -m "real_time and not thorough" $$($(REAL_TIME)) > $(VENV)/real-time.txt 2>&1 & beside=$$!; \
	nice -n 5 $(BIN)/pytest -q -n auto --maxprocesses 4 --dist worksteal -m "not real_time and not thorough"; ahead=$$?; \
	echo "beside these, in real time:"; \
	wait $$beside; late=$$?; cat $(VENV)/real-time.txt; \
	test $$ahead -eq 0 -a $$late -eq 0

# Whole matrices and long runs, of which `make test` has a part or a shorter one.
test-thorough: $(STAMPS)/test $(STAMPS)/peer
	@$(MAKE) -s firmware-sim
	@$(BIN)/pytest -q -n 2 --dist worksteal -m thorough

$(STAMPS)/mutants: $(STAMPS)/test
	@echo "adding mutmut ..."
	@$(INSTALL) -e '.[mutants]'
	@touch $@

# SAMPLE=60: of each module so many mutants, drawn by SEED, in place of all; SECONDS_EACH: most for one module.
SAMPLE ?= 0
SEED ?= 1
SECONDS_EACH ?= 600
mutants: $(STAMPS)/mutants
	@$(BIN)/python -m bench.mutants --least 0.9 --sample $(SAMPLE) --seed $(SEED) --seconds $(SECONDS_EACH)

# The documentation as a site: build/site/index.html.
docs: $(STAMPS)/test
	@$(BIN)/zensical build --clean

# The lowest versions that pyproject.toml allows: the loop runs with them, and its log replays with the pinned ones.
check-lowest: $(STAMPS)/base
	@rm -rf .venv-lowest
	@$(PYTHON) -m venv .venv-lowest
	@$(BIN)/python -c "$(LOWEST)" > .venv-lowest/lowest.txt
	@.venv-lowest/bin/python -m pip --disable-pip-version-check install -qq -c .venv-lowest/lowest.txt -e .
	@.venv-lowest/bin/asvhil sitl --lockstep --duration 60 --wind 6@90 --log .venv-lowest/log.mcap --no-picture
	@$(BIN)/asvhil replay .venv-lowest/log.mcap
LOWEST = import tomllib; \
	print(*(d.replace('>=', '==') for d in tomllib.load(open('pyproject.toml', 'rb'))['project']['dependencies']), sep='\n')

# For a computer without a network: a folder of wheels, from which pip installs the daemon (docs/installation.md). It
# fails where a package has no ready wheel. MACHINE: aarch64 (Raspberry Pi, Jetson) or x86_64; FOR: its Python.
MACHINE ?= aarch64
FOR ?= 3.11
wheelhouse: $(STAMPS)/base
	@$(BIN)/python .ci/wheelhouse.py dist/wheelhouse-$(MACHINE)-$(FOR) $(MACHINE) $(FOR)

clean:
	rm -rf firmware/arduino_anemometer/build tests/firmware/build tests/page/node_modules
	rm -rf $(VENV) .venv-lowest .venv-mavproxy .pytest_cache .mypy_cache .ruff_cache .hypothesis
