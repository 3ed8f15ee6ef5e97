# Everything runs in a virtual environment that this file makes by itself; it needs Python and make only.
#   make            make the environment
#   make demo       a sealed recording with something hidden in it, its diagnosis, and the truth
#   make PYTHON=... choose the interpreter

PYTHON ?=
WORKERS ?= 2
ARGS ?=
# The blind challenge: numbers from 20000 are kept for scoring, those up to 42199 are used up (docs/challenge.md).
CASES ?= 200
SEED ?= 42200
# The simulated yardstick: numbers 50000 to 50299; even ones may be looked at, odd ones are counted only.
HALF ?= both
LABEL ?= engine
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
PEERS := $(VENV)/.installed-peers
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet --quiet

.PHONY: install demo test proof crosscheck crosscheck-long challenge yardstick yardstick-simulated effects bench \
    work-precision speed peers evidence lint format docs site wheel clean help
.DELETE_ON_ERROR:

install: $(STAMP)
	@echo "ready: $(BIN)/missing-physics --help; see also 'make help'"

help:
	@echo "make install  make or bring up to date the environment in $(VENV)"
	@echo "make demo     seal what is hidden in a space robot's recording, diagnose it, open the seal"
	@echo "make test     the quick tests, on $(WORKERS) processes (WORKERS=, ARGS=)"
	@echo "make proof    the long proofs that 'make test' leaves out, and more random input to every reader"
	@echo "make crosscheck  both engines against each other, as a page under reports/evidence"
	@echo "make crosscheck-long  every shipped robot's whole motion in both engines, as a page under reports/evidence;"
	@echo "              ten minutes of one processor"
	@echo "make challenge  the blind challenge on CASES=$(CASES) cases from SEED=$(SEED); takes hours, goes on after an interrupt"
	@echo "make yardstick  every real machine, answers kept under LABEL=$(LABEL), as a page under reports/evidence; takes"
	@echo "              an hour or two, goes on after an interrupt; the recordings must be here (missing-physics datasets)"
	@echo "make yardstick-simulated  this engine, under LABEL=$(LABEL), on 300 drawn cases (HALF=looked, counted or"
	@echo "              both, CASES= for the first so many of them); takes hours, goes on after an interrupt;"
	@echo "              ARGS='--against FILE' compares with another engine's scores"
	@echo "make effects  every effect alone and hard pairs, from the other engine's recordings, as pages under"
	@echo "              reports/evidence; takes about an hour, goes on after an interrupt"
	@echo "make bench    speed and accuracy beside other engines, two to ten minutes; prints the ratios, writes"
	@echo "              reports/benchmarks.json, a row of the history beside it, reports/benchmarks.html, which"
	@echo "              marks what became slower, and reports/benchmarks.rrd for the rerun viewer"
	@echo "make work-precision  work and precision beside Exudyn as a page under reports/evidence; takes minutes"
	@echo "make speed    speed beside MuJoCo and Pinocchio as a page under reports/evidence"
	@echo "make peers    other tools on the same recordings as a page under reports/evidence; takes minutes"
	@echo "make evidence the pages under reports/evidence and the README's example, anew"
	@echo "make lint     ruff and mypy"
	@echo "make format   let ruff lay out the source"
	@echo "make docs     write the generated pages anew"
	@echo "make site     the documentation as a site in build/site, without the network"
	@echo "make wheel    the wheel, tried in a fresh environment of another Python, where there is one"
	@echo "make clean    remove the environment and all caches"

demo: $(STAMP)
	$(BIN)/missing-physics demo $(ARGS)

test: $(STAMP)
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal -m "not proof" $(ARGS)

proof: $(STAMP)
	$(BIN)/python -m pytest -m "proof or fuzz" --hypothesis-profile=thorough $(ARGS)

crosscheck: $(STAMP)
	$(BIN)/python -m benchmarks.cross_validation

crosscheck-long: $(STAMP)
	$(BIN)/python -m benchmarks.crosscheck.full_length $(ARGS)

challenge: $(PEERS)
	$(BIN)/missing-physics challenge --cases $(CASES) --seed $(SEED) --workers $(WORKERS) \
	    --out reports/challenge-$(SEED)-$(CASES) --evidence reports/evidence/blind_challenge.md $(ARGS)

yardstick: $(STAMP)
	$(BIN)/python -m benchmarks.yardstick.real --label $(LABEL) $(ARGS)

# CASES is that of the challenge unless it was given on the command line.
yardstick-simulated: $(STAMP)
	$(BIN)/python -m benchmarks.yardstick.simulated --half $(HALF) --engine-label $(LABEL) \
	    $(if $(filter command,$(firstword $(origin CASES))),--cases $(CASES)) $(ARGS)

effects: $(STAMP)
	$(BIN)/python -m benchmarks.effects.study --draws 1 --processes $(WORKERS) $(ARGS)
	$(BIN)/python -m benchmarks.effects.hard_pairs --processes $(WORKERS) $(ARGS)

bench: $(PEERS)
	@mkdir -p reports
	@echo "two to ten minutes on two cores; the first time two more, to compile the loops around the peers"
	started=$$(date +%s) && \
	$(BIN)/python -m benchmarks.speed.build && \
	$(BIN)/python -m pytest benchmarks -o python_files="bench_*.py test_*.py" \
	    --benchmark-enable --benchmark-columns=min,median,rounds --benchmark-json=reports/benchmarks.json $(ARGS) && \
	$(BIN)/python -m benchmarks.history reports/benchmarks.json --started $$started

work-precision: $(PEERS)
	$(BIN)/python -m benchmarks.work_precision.study

speed: $(PEERS)
	$(BIN)/python -m benchmarks.speed.study

peers: $(PEERS)
	$(BIN)/python -m benchmarks.peers.study

evidence: $(STAMP)
	$(BIN)/python -m benchmarks.speed.diagnosis_time
	$(BIN)/python -m benchmarks.speed.long_recording
	$(BIN)/python -m benchmarks.friction.study
	$(BIN)/python -m benchmarks.yardstick.likelihood
	$(BIN)/python -m benchmarks.yardstick.kalman
	$(BIN)/python -m benchmarks.machines.readme

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(STAMP)
	$(BIN)/python -m robot_model.page > docs/.robot.md && mv docs/.robot.md docs/robot.md
	$(BIN)/python -m reference_model.effects.page docs/effects.md
	$(BIN)/python -m benchmarks.signatures.pictures

site: $(STAMP)
	@$(PIP) install -c constraints.txt -e ".[docs]"
	$(BIN)/python docs/pages.py
	$(BIN)/python -m mkdocs build --quiet --clean

# The newest Python that is not that of the environment.
wheel: $(STAMP)
	@rm -rf build/wheel && mkdir -p build/wheel
	@$(PIP) wheel --no-deps -w build/wheel .
	@own=$$($(BIN)/python -c 'import sys; print("%d.%d" % sys.version_info[:2])'); \
	for version in 3.13 3.12 3.11; do \
	  if [ $$version != $$own ] && python$$version -c '' 2>/dev/null; then other=python$$version; break; fi; \
	done; \
	if [ -z "$$other" ]; then echo "no other Python than $$own is here: the wheel was built and not tried"; exit 0; fi; \
	$$other -m venv build/wheel/env && \
	build/wheel/env/bin/python -m pip --disable-pip-version-check -q install -c constraints.txt build/wheel/*.whl && \
	cd build/wheel && env/bin/missing-physics --version && \
	env/bin/missing-physics simulate single_axis --out axis.csv --quiet && \
	env/bin/missing-physics inspect axis.csv --robot single_axis --quiet > /dev/null && \
	env/bin/missing-physics diagnose single_axis axis.csv --out out --quiet > /dev/null && \
	echo "the wheel works in $$(env/bin/python --version)"

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis .benchmarks build dist *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# An environment whose interpreter has gone (a moved folder, a removed Python) is made anew.
ifneq ($(shell $(BIN)/python -c "print('sound')" 2>/dev/null),sound)
.PHONY: $(BIN)/python $(STAMP)
endif

$(BIN)/python:
	@chosen=; \
	for candidate in $(PYTHON) $(if $(PYTHON),,python3.13 python3.12 python3.11 python3 python); do \
	  if "$$candidate" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null; \
	  then chosen=$$candidate; break; fi; \
	done; \
	if [ -z "$$chosen" ]; then \
	  echo "make: no Python 3.11, 3.12 or 3.13 found$(if $(PYTHON), at $(PYTHON));" \
	       "install one, or name it: make PYTHON=/path/to/python3" >&2; exit 1; fi; \
	echo "making $(VENV) with $$("$$chosen" --version)"; \
	rm -rf $(VENV); \
	"$$chosen" -m venv $(VENV) || { rm -rf $(VENV); \
	  echo "make: $$chosen cannot make virtual environments;" \
	       "install its venv module (on Debian: apt install python3-venv)" >&2; exit 1; }

$(STAMP): pyproject.toml constraints.txt | $(BIN)/python
	@echo "installing into $(VENV); the first time this takes a few minutes"
	@$(PIP) install -c constraints.txt -e ".[test,lint]"
	@touch $@

$(PEERS): $(STAMP)
	@$(PIP) install -c constraints.txt -e ".[peers]"
	@touch $@
