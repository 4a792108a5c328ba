use super::*;

fn estimate(t_ns: i64) -> SettledEstimate {
    SettledEstimate {
        time: Timestamp(t_ns),
        boot: BootIndex(2),
        pose: Pose2::new(0.1 + 0.2, -1e-17, 3.0),
        covariance: Symmetric3([1.0 / 3.0, -0.0, 2.0, 1e-300, 5.5, 7.0]),
        nominal: Pose2::new(-4.0, 1e10, -3.0),
    }
}

fn times(folder: &Path, file: &str) -> Vec<i64> {
    read_estimates(&folder.join(file)).unwrap().iter().map(|estimate| estimate.time.0).collect()
}

#[test]
fn estimates_read_back_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let one = estimate(1_248_273_546_275_000_001);
    let trajectories = Trajectories::open(folder.path(), true).unwrap();
    trajectories.finish(&[one]).unwrap();
    write_summary(folder.path(), &AgentSummary::default()).unwrap();
    assert_eq!(read_estimates(&folder.path().join(SETTLED)).unwrap(), [one]);
    assert_eq!(read_estimates(&folder.path().join(ONLINE)).unwrap(), []);
    assert_eq!(read_summary(folder.path()).unwrap(), AgentSummary::default());
}

#[test]
fn a_second_life_goes_on_with_the_files_of_the_first_and_a_line_cut_off_is_dropped() {
    let folder = tempfile::tempdir().unwrap();
    let mut first = Trajectories::open(folder.path(), true).unwrap();
    first.online(&estimate(1)).unwrap();
    first.closed(&[estimate(1), estimate(2)]).unwrap();
    first.online(&estimate(2)).unwrap();
    drop(first);
    let online = folder.path().join(ONLINE);
    let text = std::fs::read_to_string(&online).unwrap();
    std::fs::write(&online, &text[..text.len() - 5]).unwrap();
    let mut second = Trajectories::open(folder.path(), false).unwrap();
    second.online(&estimate(3)).unwrap();
    // The power went before the cut was on the disk: it is closed once more.
    second.closed(&[estimate(2), estimate(3)]).unwrap();
    second.finish(&[estimate(4)]).unwrap();
    assert_eq!(times(folder.path(), ONLINE), [1, 3]);
    assert_eq!(times(folder.path(), SETTLED), [1, 2, 3, 4]);
    // Finished again, nothing is there twice.
    second.finish(&[estimate(4), estimate(5)]).unwrap();
    assert_eq!(times(folder.path(), SETTLED), [1, 2, 3, 4, 5]);
    let third = Trajectories::open(folder.path(), true).unwrap();
    third.finish(&[]).unwrap();
    assert_eq!((times(folder.path(), ONLINE), times(folder.path(), SETTLED)), (vec![], vec![]));
}

#[test]
fn a_damaged_line_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(SETTLED);
    std::fs::write(&path, format!("{COLUMNS}\n1,0,1,2,3\n")).unwrap();
    assert!(matches!(read_estimates(&path).unwrap_err(), ResultsError::Line { line: 2, .. }));
    for (text, at) in [("something else\n".to_owned(), 1), (format!("{COLUMNS}\n1,0,1,2,3\n"), 2)] {
        std::fs::write(folder.path().join(ONLINE), text).unwrap();
        let error = Trajectories::open(folder.path(), false).unwrap_err();
        assert!(matches!(error, ResultsError::Line { line, .. } if line == at), "{error}");
    }
}
