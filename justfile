# `just` lists the tasks. The checks themselves are in .ci/run, so that there is one list of them.

# Where the recordings are.
export PLEIAD_RECORDINGS := env("PLEIAD_RECORDINGS", justfile_directory() / "../shared/recordings")

[private]
default:
    @just --list

# Everything that must hold before a change is accepted; changes nothing.
verify:
    .ci/run --no-install

# Formats, and applies what clippy can correct by itself.
fix:
    cargo clippy --workspace --all-targets --fix --allow-dirty --allow-staged
    cargo fmt --all
    rustfmt --edition 2024 physics/src/effects/*.rs

# All tests that need nothing beyond the repository.
test:
    cargo test --workspace

# The demonstration: what relative observations can and cannot tell.
demo *arguments:
    cargo run -- demo {{ arguments }}

# The tests on real and simulated recordings.
recordings:
    cargo test -p pleiad-recording --features recordings --test real
    cargo test -p pleiad-mismatch --features recordings --test recordings
    cargo test -p pleiad-tests --features recordings --test recordings --test recordings_diagnosis --test recordings_mrclam_diagnosis --test recordings_faults --test recordings_slam

# What rosbags, mcap, pymap3d and evo say of our files; installs them into target/python.
witnesses:
    .ci/python-venv
    cargo test -p pleiad-ros -p pleiad-recording --features pleiad-ros/python,pleiad-recording/python --test rosbags --test python

# Consistency over many seeded runs; takes minutes.
monte-carlo:
    cargo test -p pleiad-tests --features slow --test monte_carlo

# How well each effect of the catalogue is estimated: the table of docs/benchmarks/effects.md. Takes minutes.
effects *arguments:
    cargo run -p pleiad-tests --example effects -- --out docs/benchmarks/effects.md {{ arguments }}

# What the diagnosis names in a hundred recordings without effects: the table of docs/benchmarks/clean.md. Takes an hour.
clean *arguments:
    cargo run -p pleiad-tests --example clean -- --out docs/benchmarks/clean.md {{ arguments }}

# Whether every effect of the catalogue is named: the table of docs/benchmarks/naming.md. Takes an hour.
naming *arguments:
    cargo run -p pleiad-tests --example naming -- --out docs/benchmarks/naming.md {{ arguments }}

# The documentation of the workspace's own crates, warnings denied.
docs:
    RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps

# Licences, sources, bans and advisories of the dependencies.
deny:
    cargo deny --all-features check

# The same bits with and without fused multiply-add.
golden:
    .ci/golden-without-fma

# Every study of the survey with the seeds it needs; takes minutes. A claim that does not hold fails it.
survey:
    for study in umbmark kalman gyro rover skid-steer slam hypotheses motion-policies; do cargo run -- survey $study || exit 1; done
