//! Images of many origins, good and bad.
use std::path::Path;
use tress::image::{Limits, read};
#[test]
fn probe() {
    let f = std::env::var("F").unwrap();
    for f in f.split_whitespace() {
        let t = std::time::Instant::now();
        std::fs::write("/proc/self/clear_refs", "5").ok();
        let r = read(Path::new(f), &Limits::default());
        let hwm = std::fs::read_to_string("/proc/self/status")
            .unwrap()
            .lines()
            .find(|l| l.starts_with("VmHWM"))
            .unwrap()
            .to_owned();
        match r {
            Ok(i) => println!(
                "OK {}x{} {:?} {:?} {:?} {:?}",
                i.width,
                i.height,
                i.origin,
                i.full_size,
                i.channels,
                i.rgb().map(|i| i.width).map_err(|e| e.to_string())
            ),
            Err(e) => println!("ERR {e}"),
        }
        println!("   {hwm} {:?}", t.elapsed());
    }
}
