# Two commands do everything on a machine with Python 3.10+ and a Rust toolchain:
#   make demo    build, estimate the bundled scene, draw it
#   make test    all tests, lints, type checks and documentation examples
# `make test-train` adds the tests of training and export (PyTorch, several GB).
# `make results` measures again what docs/results.md says (half an hour on a quiet machine).

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
export PYO3_PYTHON := $(CURDIR)/$(BIN)/python
# the same random cases in every run of the tests; other seeds find other cases
export PROPTEST_RNG_SEED ?= 0
RUST_SOURCES := Cargo.toml Cargo.lock pyproject.toml $(shell find src -name '*.rs')

.PHONY: demo test test-rust test-python test-train lint results clean

demo: $(VENV)/installed
	$(BIN)/groundpose demo

test: lint test-rust test-python

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip

# the package with its native module, rebuilt when a Rust source changes
$(VENV)/installed: $(BIN)/python $(RUST_SOURCES)
	$(BIN)/pip install --quiet --editable .
	touch $@

$(VENV)/installed-dev: $(VENV)/installed
	$(BIN)/pip install --quiet --editable '.[dev]'
	touch $@

lint: $(VENV)/installed-dev
	cargo fmt --check
	cargo clippy --quiet --all-targets --features python -- --deny warnings
	cargo clippy --quiet --no-default-features -- --deny warnings
	cargo clippy --quiet --all-targets --features synthetic -- --deny warnings
	RUSTDOCFLAGS='--deny warnings' cargo doc --quiet --no-deps --features synthetic
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

test-rust: $(BIN)/python
	cargo test --quiet --features synthetic

test-python: $(VENV)/installed-dev
	$(BIN)/pytest --quiet

# what trains and exports networks: PyTorch is several GB, so this is apart
test-train: $(VENV)/installed-dev
	$(BIN)/pip install --quiet --editable '.[train]'
	$(BIN)/pytest --quiet tests/python/test_training.py tests/python/test_training_streets.py tests/python/test_networks_measured.py

results: $(VENV)/installed-dev
	$(BIN)/pip install --quiet --editable '.[rivals]'
	# a bar that is not met is a result, not a failure of make
	-$(BIN)/python -m groundpose.evaluate.bars
	-$(BIN)/python -m groundpose.evaluate.bars --seed 1 --only v1,e1,e1-90,e1-tilt,chance --out results/solver_seed1.json
	$(BIN)/python -m groundpose.evaluate.real

clean:
	rm -rf target $(VENV)
