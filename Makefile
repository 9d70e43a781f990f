# Two commands do everything on a machine with Python 3.10+ and a Rust toolchain:
#   make demo    build, estimate the bundled scene, draw it
#   make test    all tests, lints, type checks and documentation examples
# `make test-kernels` repeats the tests of numbers on other BLAS kernels and vector units of NumPy.
# `make test-train` adds the tests of training and export (PyTorch, several GB).
# `make train-gpu` renders crops and trains the networks of a release on a machine with a GPU.
# `make docs` builds the documentation site.
# `make results` measures again what docs/results.md says (half an hour on a quiet machine),
# `make bench` what docs/performance.md says (a quarter of an hour), `make bench-compare` whether anything got slower.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
export PYO3_PYTHON := $(CURDIR)/$(BIN)/python
# the same random cases in every run of the tests; other seeds find other cases
export PROPTEST_RNG_SEED ?= 0
RUST_SOURCES := Cargo.toml Cargo.lock pyproject.toml $(shell find src -name '*.rs')

# boards without an operating system on which the crate is tried, where the toolchain and QEMU are there
BARE_METAL := thumbv7em-none-eabihf aarch64-unknown-none

# tests share what their file prepares
ON_ALL_CORES := --numprocesses auto --dist loadfile
TESTS_OF_TRAINING := $(addprefix tests/python/test_,training.py training_streets.py networks_measured.py networks_joined.py enlarged.py)

.PHONY: demo test test-rust test-python test-kernels test-train train-gpu lint docs results bench bench-compare package wheel clean

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
	cargo fmt --check --manifest-path probe/Cargo.toml
	cargo fmt --check --manifest-path examples/embedded/Cargo.toml
	cargo clippy --quiet --all-targets --features python -- --deny warnings
	cargo clippy --quiet --no-default-features -- --deny warnings
	cargo clippy --quiet --all-targets -- --deny warnings
	RUSTDOCFLAGS='--deny warnings --html-in-header docs/katex-header.html' cargo doc --quiet --no-deps --features synthetic
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

test-rust: $(BIN)/python
	-rustup --quiet target add $(BARE_METAL)
	cargo test --quiet

# a file of tests on each core
test-python: $(VENV)/installed-dev
	$(BIN)/pytest --quiet $(ON_ALL_CORES)

# the tests that compare numbers, with NumPy computing as it does on other processors
test-kernels: $(VENV)/installed-dev
	$(BIN)/python tests/python/kernels.py

# what trains and exports networks: PyTorch is several GB, so this is apart
test-train: $(VENV)/installed-dev
	$(BIN)/pip install --quiet --editable '.[train]'
	$(BIN)/pytest --quiet $(ON_ALL_CORES) $(TESTS_OF_TRAINING)

# the networks of a release on a machine with a GPU: one rendering, then one training each
train-gpu: $(VENV)/installed-dev
	$(BIN)/pip install --quiet --editable '.[train]'
	$(BIN)/groundpose train lite48 --device cuda --render --minutes 9.5 --data data/crops -o runs/lite48
	$(BIN)/groundpose train lite32 --device cuda --fit-minutes 4 --data data/crops -o runs/lite32
	$(BIN)/groundpose train res10-128x96-paper --device cuda --fit-minutes 8 --data data/crops -o runs/res10-128x96

# the documentation site in target/site: notebooks are run, a broken link or any other warning fails
docs: $(VENV)/installed
	$(BIN)/pip install --quiet --editable '.[docs]'
	PATH="$(CURDIR)/$(BIN):$$PATH" NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

results: $(VENV)/installed-dev
	$(BIN)/pip install --quiet --editable '.[rivals]'
	# a target that is not met is a result, not a failure of make; nor are real data that are not there (GROUNDPOSE_DATA)
	-$(BIN)/groundpose evaluate targets
	-$(BIN)/groundpose evaluate targets --seed 1 --only v1,e1,e1-90,e1-tilt,chance --out results/solver_seed1.json
	-$(BIN)/groundpose evaluate real

bench: $(VENV)/installed-dev
	$(BIN)/pip install --quiet --editable '.[rivals]'
	$(BIN)/groundpose bench --instructions --native --fresh -o results/bench.json --figure docs/performance.png --save-baseline results/bench_baseline.json
	$(BIN)/groundpose evaluate pages

bench-compare: $(VENV)/installed-dev
	$(BIN)/pip install --quiet --editable '.[rivals]'
	$(BIN)/groundpose bench --instructions -o target/bench.json --fresh --compare results/bench_baseline.json

# what `cargo publish` would send, built as its users build it
package:
	cargo publish --dry-run --locked

# the wheel for this machine's platform, tried in an environment of its own; on Linux for glibc 2.28 and later
wheel: $(BIN)/python
	$(BIN)/pip install --quiet 'maturin[zig]>=1.9,<2'
	rm -rf target/wheels
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/maturin build --release --locked --out target/wheels \
		$(if $(filter Linux,$(shell uname)),--zig --compatibility manylinux_2_28)
	$(BIN)/python tests/try_wheel.py target/wheels/groundpose-*.whl

clean:
	rm -rf target $(VENV)
