# Each target does its own set-up (.ci/setup); `make` alone lists them.
#
# VENV=.venv       the virtual environment to make and use
# PYTHON=python3   the Python that makes it, 3.10 or newer
# WAMNET_REQUIRE=  executors whose absence fails `make test`; empty: skip, and say so, what is not there;
#                  c is among them where $(CC) finds the C library
# MINUTES=10       how long `make fuzz` goes on
# COUNT=, SEED=    how many faults `make faults` has, and which
# ALSO=            what must be there besides, as torch,pyoidn after `make baselines`

VENV ?= .venv
PYTHON ?= python3
comma := ,
WAMNET_REQUIRE ?= opencl,opengl-egl,opengl-osmesa,mitsuba,chromium,bubblewrap$(if $(shell $(CC) -E -include math.h -x c /dev/null >/dev/null 2>&1 && echo yes),$(comma)c)
override WAMNET_REQUIRE := $(WAMNET_REQUIRE)$(if $(ALSO),$(comma)$(ALSO))
# A file's tests share what its fixtures make: one worker runs them.
PYTEST_OPTIONS ?= -n 2 --dist loadfile
MINUTES ?= 10
COUNT ?= 300
export VENV PYTHON WAMNET_REQUIRE
# Without byte code on disk every process of the tests would compile the package, and each worker all tests.
unexport PYTHONDONTWRITEBYTECODE

# Seconds of processor time that the tests may take (tests/support/tiers.py).
QUICK_S = 290
TEST_S = 800

# Two workers share two cores: one thread of linear algebra each.
ONE_THREAD = OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1

.DEFAULT_GOAL := help
.PHONY: help setup baselines demo docs quick test nightly long fuzz faults hosts lint clean distclean

help: ## List the targets
	@grep -hE '^[a-z]+: .*## ' Makefile | sed -E 's/^([a-z]+):.*## (.*)/  make \1	\2/' | expand -t 20

setup: ## Make the environment with everything in it
	@.ci/setup all

baselines: setup ## Add PyTorch and Open Image Denoise, with which all tests of the paper's baselines run
	@.ci/setup baselines

demo: ## Render, train, compile, run and compare; results in out/demo (5 minutes on two cores)
	@.ci/setup full
	@$(VENV)/bin/wamnet demo -o out/demo

docs: ## Build the web site: spec, tutorial, course; open out/site/index.html
	@.ci/setup docs
	@$(VENV)/bin/python docs/site/build.py

quick: ## Run the tests that need NumPy, and no device, compiler or browser (two and a half minutes on two cores)
	@.ci/setup quick
	@WAMNET_REQUIRE= $(ONE_THREAD) $(VENV)/bin/pytest $(PYTEST_OPTIONS) --quick -rfE --budget $(QUICK_S)

test: setup ## Run the tests, those of devices and programs too (ten minutes on two cores)
	@$(ONE_THREAD) $(VENV)/bin/pytest $(PYTEST_OPTIONS) --budget $(TEST_S)

nightly: baselines ## Run every test and all combinations of parameters, then long, fuzz and faults (hours on two cores)
	@$(ONE_THREAD) $(VENV)/bin/pytest $(PYTEST_OPTIONS) --nightly
	@$(MAKE) --no-print-directory long
	@$(MAKE) --no-print-directory fuzz MINUTES=60
	@$(MAKE) --no-print-directory faults

long: setup ## Test kernels with other cases each time, many and wide (2 hours on two cores); SEED=n repeats a run
	@$(ONE_THREAD) PYTEST_OPTIONS="$(PYTEST_OPTIONS)" .ci/long $(TESTS)

fuzz: setup ## Feed changed files and options to every reader and command; MINUTES=10, SEED=n repeats a run, ONLY=name, AT=n one input
	@$(ONE_THREAD) PYTHONPATH=tests/fuzz:tests/support $(VENV)/bin/python tests/fuzz/fuzz.py --minutes $(MINUTES) \
		$(if $(SEED),--seed $(SEED)) $(if $(ONLY),--only "$(ONLY)") $(if $(AT),--at $(AT)) \
		$(if $(STATE),--state $(STATE)) $(if $(INPUTS),--inputs $(INPUTS))

faults: setup ## Kill commands and workers, fill their disk, start two at once: COUNT=300 times (an hour); SEED=n repeats
	@$(ONE_THREAD) $(VENV)/bin/python tests/support/faults.py --count $(COUNT) $(if $(SEED),--seed $(SEED))

hosts: setup ## Run the programs of `wamnet export --host` in all hosts that can be had, and say which are missing
	@.ci/setup hosts
	@WAMNET_REQUIRE= $(ONE_THREAD) $(VENV)/bin/pytest --nightly -rsfE -v tests/kernels/export/test_hosts.py

lint: setup ## Check style, format, types on the installed wheel, and the house rules
	@.ci/lint

clean: ## Remove results and caches
	rm -rf out build dist *.egg-info .pytest_cache .hypothesis .mypy_cache .ruff_cache
	find . -name __pycache__ -not -path './.venv*' -prune -exec rm -rf {} +

distclean: clean ## Remove the virtual environment too
	rm -rf .venv
