# make             builds ./actcheck; on Debian and Ubuntu it installs first what the build needs from the system
# make test        builds and passes all tests
# make bench       what things cost, as ratios
# make wheel       a wheel of the program and its Python package, and a source distribution, in dist
# make notebooks   runs the notebooks on fresh campaigns and keeps their outputs (RUNS=200)
#
# RocksDB and polars are compiled once, in one profile, into a folder that outlives this checkout (`.ci/env`).

.PHONY: build test bench wheel notebooks

build:
	@sh .ci/system
	@sh .ci/build

test:
	@sh .ci/system tests
	@sh .ci/build
	@sh .ci/test

bench:
	@sh .ci/system tests
	@. .ci/env && cargo bench --locked

wheel:
	@sh .ci/system wheel
	@sh clients/wheel/build

RUNS ?= 200

notebooks: build
	@. .ci/env && python="$$CARGO_TARGET_DIR/tmp/notebooks" && python3 -m venv "$$python" && \
		"$$python/bin/python" -m pip install --quiet --disable-pip-version-check -r tests/foreign/requirements.txt && \
		"$$python/bin/python" notebooks/regenerate.py --runs $(RUNS)
