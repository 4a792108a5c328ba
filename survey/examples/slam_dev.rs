#![allow(clippy::all, clippy::pedantic, clippy::print_stdout, missing_docs)]
fn main() {
    let n: usize = std::env::args().nth(1).unwrap().parse().unwrap();
    let first: u64 = std::env::args().nth(2).unwrap().parse().unwrap();
    let start = std::time::Instant::now();
    let study = pleiad_survey::slam::study(&pleiad_survey::StudyOptions { seeds: Some(n), first_seed: first }).unwrap();
    for claim in &study.claims {
        println!("{} {}\n     {}", claim.holds, claim.statement, claim.measured);
    }
    println!("{}", serde_json::to_string(&study.numbers).unwrap());
    println!("{:?}", start.elapsed());
}
