fn main() {
    for path in std::env::args().skip(1) {
        println!("== {path}");
        let (rec, _) = pleiad_recording::open(std::path::Path::new(&path), &Default::default()).unwrap();
        pleiad_mismatch::probe(&rec);
    }
}
