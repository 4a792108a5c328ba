//! Writes the tables of `docs/benchmarks/mrclam-diagnosis.md`.

use std::io::Write as _;

use pleiad_tests::mrclam::{CHANGES, differences, recording};

fn main() -> std::io::Result<()> {
    let mut out = std::io::stdout();
    let recording = recording(6);
    for change in CHANGES {
        for own in differences(&recording, change) {
            writeln!(
                out,
                "{} r{} {} {:.5} -> {:.5} diff {:.5} injected {:.5} half {:.5}",
                own.change,
                own.robot,
                own.parameter,
                own.unchanged,
                own.changed,
                own.found(),
                own.injected,
                own.half_width
            )?;
        }
    }
    Ok(())
}
