# Everything a fresh machine needs is set up by these targets: Python >= 3.11, make and pip are enough.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
SYSTEMS := linux win32 darwin
LAST := $(lastword $(SYSTEMS))
# The tests start Python about a hundred times, so compiled modules are kept even if the environment forbids it.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: run test lint kernels rewritten types $(SYSTEMS:%=types-%) types-benchmarks unit slow mutants attack bench bench-loop bench-drives bench-coverage bench-sites bench-soak bench-streaming screen screenshots session clean test-lowest app deb

run: $(READY)
	$(BIN)/python -m app.command_line.start

# The kernels are compiled on one core: types are checked on the other meanwhile, the last system's beside the tests,
# which often wait; all give way.
test: lint
	@$(MAKE) --no-print-directory --jobs 4 kernels rewritten $(patsubst %,types-%,$(filter-out $(LAST),$(SYSTEMS)))
	@$(MAKE) --no-print-directory --jobs 2 unit types-$(LAST)

lint: $(READY)
	$(BIN)/ruff check .

# as on this machine, and as on the other two: what a system lacks is seen without it
types: $(READY)
	@$(MAKE) --no-print-directory --jobs $(SYSTEMS:%=types-%) types-benchmarks

$(SYSTEMS:%=types-%): types-%: $(READY)
	nice $(BIN)/mypy --platform $* --cache-dir .mypy_cache/$*

# what is run once a week calls what there is
types-benchmarks: types-linux
	nice $(BIN)/mypy --platform linux --cache-dir .mypy_cache/linux -p tests.benchmarks -p tests.attack -p tests.bench

# each once: two workers that meet an uncompiled one would both compile it
kernels: $(READY)
	$(BIN)/python -m app --prepare

# pytest rewrites the tests' assertions so that failures show values: once here, not once in each worker.  Errors are
# shown by ``unit``.
rewritten: $(READY)
	@nice $(BIN)/python -m pytest --collect-only -qqq > /dev/null || true

unit: kernels
	QT_QPA_PLATFORM=offscreen $(BIN)/python -m pytest --numprocesses auto --maxprocesses 4 --dist worksteal --durations 25 -m "not slow"

# what takes too long for every change: measured collisions, a law learned through the command line
slow: $(READY)
	QT_QPA_PLATFORM=offscreen $(BIN)/python -m pytest -m slow

# 200 faults drawn by a seed, each in a copy of the program: does a test notice?  An hour or two on two cores
mutants: $(READY)
	nice $(BIN)/python -m tests.mutants --faults 200 --seed 1

bench: $(READY)
	QT_QPA_PLATFORM=offscreen $(BIN)/python -m tests.benchmarks

# >= 2,000 simulated shots, 100 kills, 12,000 spoilt files: half an hour on two cores
bench-soak: $(READY)
	$(BIN)/python -m tests.benchmarks.soak --shots 2000 --apart
	$(BIN)/python -m tests.benchmarks.kill --times 100
	$(BIN)/python -m tests.benchmarks.fuzz --times 12000

# crafted files, untrue recordings, extremes, rogue devices, crowds, a cluster and a full disk on this machine: half an hour
attack: $(READY)
	QT_QPA_PLATFORM=offscreen $(BIN)/python -m tests.attack

bench-streaming: $(READY)
	QT_QPA_PLATFORM=offscreen $(BIN)/python -m tests.benchmarks.streaming --seconds 60

bench-loop: $(READY)
	$(BIN)/python -m tests.benchmarks.loop --seed 2 --keep .bench/loop.jsonl --page docs/closed-loop-benchmark.md
	$(BIN)/python -m tests.benchmarks.laws --seed 2 --keep .bench/laws.jsonl --page docs/closed-loop-laws.md
	$(BIN)/python -m tests.benchmarks.next_shots --seed 2 --random 5 --keep .bench/next_shots.jsonl --page .bench/next_shots.md

# clean drives of several kinds: how many are given a law that they have not?
bench-drives: $(READY)
	$(BIN)/python -m tests.benchmarks.drives --count 84

# 3,000 shots in buildings: do the 95 % intervals hold?  About an hour on two cores
bench-coverage: $(READY)
	$(BIN)/python -m tests.benchmarks.coverage --shots 3000 --seed 2 --keep .bench/coverage.jsonl --page docs/uncertainty.md

# the diagnosis in buildings: 100 clean sets a site, and every effect at twelve norms of the site's noise: some hours
bench-sites: $(READY)
	$(BIN)/python -m tests.benchmarks.buildings --clean 43 --effects 3 --seed 2 --keep .bench/buildings.jsonl
	$(BIN)/python -m tests.benchmarks.sites --clean 100 --effects 5 --seed 2 --keep .bench/sites.jsonl
	$(BIN)/python -m tests.benchmarks.sites --clean 100 --recorded --seed 2 --keep .bench/sites-recorded.jsonl

# what each page and report shows, as text that tests compare with, and the tables of thresholds and effects in docs/:
# written anew, to be read before it is committed
screen: $(READY)
	LEVIMASS_WRITE_SCREEN=1 QT_QPA_PLATFORM=offscreen $(BIN)/python -m pytest tests/app/window tests/app/report tests/app/session tests/app/command_line tests/instrument/bench/test_seed.py tests/analysis/diagnosis/test_criteria.py tests/analysis/diagnosis/test_catalogue.py

screenshots: $(READY)
	QT_QPA_PLATFORM=offscreen $(BIN)/python -m tests.app.screenshots docs/images

# a whole session through the real window on virtual screens (Xvfb): light, dark, and twice as dense
session: $(READY)
	$(BIN)/python -m tests.app.virtual_screen .session/light light
	$(BIN)/python -m tests.app.virtual_screen .session/dark dark
	$(BIN)/python -m tests.app.virtual_screen .session/dense light 2

# the oldest versions that pyproject.toml allows, in an environment of their own (Python 3.11: newer ones have no such)
LOWEST_TESTS = tests/test_house.py tests/analysis/compiled/test_kernel_cache.py tests/analysis/signal \
	tests/instrument/test_recording_file.py tests/app/test_settings.py tests/app/test_cli.py tests/app/test_pyramid.py
test-lowest:
	$(PYTHON) -m venv .venv-lowest
	$(PYTHON) packaging/lowest.py > .venv-lowest/lowest.txt
	.venv-lowest/bin/python -m pip install --quiet --requirement .venv-lowest/lowest.txt
	.venv-lowest/bin/python -m pip install --quiet --no-deps --editable .
	QT_QPA_PLATFORM=offscreen .venv-lowest/bin/python -m pytest $(LOWEST_TESTS)

# one folder in dist/ that needs no Python; frozen anew where something of it is newer
FROZEN := dist/.frozen
WITHIN := analysis app instrument levimass resources packaging
app: $(FROZEN)

$(FROZEN): $(READY) LICENSE $(shell find $(WITHIN) -type f -not -path '*/__pycache__/*')
	$(BIN)/python -m pip install --quiet 'pyinstaller>=6.10'
	$(BIN)/python -m PyInstaller --noconfirm --log-level WARN packaging/levimass.spec
	@touch $@

# that folder as a Debian package
deb: $(FROZEN)
	$(BIN)/python packaging/deb.py dist/levimass dist

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "levimass needs Python 3.11 or newer; $(PYTHON) is older (make PYTHON=/path/to/python3.11 ...)"; exit 1; }
	@$(PYTHON) -m venv $(VENV) || { echo "this Python cannot make virtual environments; on Debian: apt install python3-venv"; exit 1; }
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable '.[test]'
	@touch $@

clean:
	rm -rf $(VENV) .venv-lowest
