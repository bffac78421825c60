# make         what the machine lacks, then the program, as ./actcheck
# make test    all tests (the report's in Chromium, which is installed where it is missing)
# make bench   what things cost, as ratios
# make notebooks   runs the notebooks on fresh campaigns and keeps their outputs (RUNS=200)
#
# RocksDB and polars are compiled once, in one profile, into a folder that outlives this checkout.

export CARGO_TARGET_DIR ?= $(or $(XDG_CACHE_HOME),$(HOME)/.cache)/actcheck/target

.PHONY: build test bench notebooks system

build: system
	cargo build --release --locked
	ln -sfn "$(CARGO_TARGET_DIR)/release/actcheck" actcheck

test: build
	@sh .ci/system browser
	cargo test --release --locked

bench: system
	@sh .ci/system browser
	cargo bench --locked

RUNS ?= 200
PYTHON_FOR_NOTEBOOKS := $(CARGO_TARGET_DIR)/tmp/python

notebooks: build
	python3 -m venv "$(PYTHON_FOR_NOTEBOOKS)"
	"$(PYTHON_FOR_NOTEBOOKS)/bin/python" -m pip install --quiet --disable-pip-version-check -r tests/foreign/requirements.txt
	"$(PYTHON_FOR_NOTEBOOKS)/bin/python" notebooks/regenerate.py --runs $(RUNS)

system:
	@sh .ci/system
