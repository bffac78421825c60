# make             builds ./actcheck; on Debian and Ubuntu it first installs missing system packages
# make test        builds and runs all tests
# make bench       runs the benchmarks, which print ratios
# make judge       compiles the rules for Python programs (`actcheck.Judge`) into clients/python
# make wheel       builds a wheel of the program and its Python package, and a source distribution, in dist
# make notebooks   runs the notebooks on new campaigns, saves their outputs and draws the pictures (RUNS=300)
# make gallery     writes docs/gallery.md: failures of the shipped campaigns, each with its smallest scene and proof
#
# Dependencies are compiled once, in one profile, into a folder outside this checkout (`.ci/env`).

.PHONY: build test bench judge wheel notebooks gallery

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

judge:
	@sh .ci/system wheel
	@sh .ci/judge

wheel:
	@sh .ci/system wheel
	@sh clients/wheel/build

RUNS ?= 300

notebooks: build
	@. .ci/env && python="$$CARGO_TARGET_DIR/tmp/notebooks" && python3 -m venv "$$python" && \
		"$$python/bin/python" -m pip install --quiet --disable-pip-version-check -r tests/foreign/requirements.txt && \
		"$$python/bin/python" notebooks/regenerate.py --runs $(RUNS) --pictures

gallery: build
	@python3 docs/gallery/make.py
