# Every command of a developer; .ci/run calls the same.

CARGO ?= cargo

.PHONY: build test lint doc bench peers bless floors check soak fuzz

build:
	$(CARGO) build --release

test:
	$(CARGO) test --workspace

# Formatting, then clippy with warnings as errors.
lint:
	$(CARGO) fmt --all --check
	$(CARGO) clippy --workspace --all-targets -- -D warnings

doc:
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --workspace --no-deps

bench:
	$(CARGO) bench --workspace

# Beside Embree, on the scenes in ../shared: needs g++ and libembree-dev.
peers:
	tools/peers.sh

# Writes golden pictures and snapshots anew; look at them before you commit them.
bless:
	BLESS=1 $(CARGO) test --workspace

# What each crate depends on, names only, against docs/floors.txt: a new arrow is a
# reviewed line.
floors:
	@for crate in nurbray-kernel nurbray-formats nurbray; do \
		echo "$$crate"; \
		$(CARGO) tree -p $$crate -e normal --depth 1 --prefix none --format "{p}" \
			| tail -n +2 | cut -d ' ' -f 1 | LC_ALL=C sort -u | sed 's/^/  /'; \
	done | diff docs/floors.txt - && echo "floors: as in docs/floors.txt"

check: lint doc floors

# Random files for all readers, for half an hour: needs nightly and cargo-fuzz.
fuzz:
	tools/fuzz.sh -max_total_time=1800

# Long random sweeps: the tests that are ignored otherwise.
soak:
	$(CARGO) test --workspace -- --ignored
