# make         what the machine lacks, then the program, as ./actcheck
# make test    all tests
# make bench   what things cost, as ratios
#
# RocksDB and polars are compiled once, in one profile, into a folder that outlives this checkout.

export CARGO_TARGET_DIR ?= $(or $(XDG_CACHE_HOME),$(HOME)/.cache)/actcheck/target

.PHONY: build test bench system

build: system
	cargo build --release --locked
	ln -sfn "$(CARGO_TARGET_DIR)/release/actcheck" actcheck

test: build
	cargo test --release --locked

bench: system
	cargo bench --locked

system:
	@sh .ci/system
