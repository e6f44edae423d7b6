use splatsim::{compare::*, fixed, quantise::quantise, scene::*};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let scene = Scene::load(&a[1], &Overrides::default()).unwrap();
    let machine = rtl_model::Machine::named(&a[2]).unwrap();
    let e = fixed::elaborate(&machine).unwrap();
    let q = quantise(&scene, &machine).unwrap();
    let t = std::time::Instant::now();
    let l = lockstep(&scene, &e, &q);
    println!("{} {}: {:?} violations {} in {:?}", a[1], a[2], l.flips, l.violations, t.elapsed());
    let d = fixed::draw(&e, &q, &mut rtl_model::probe::Unwatched);
    let f = fixed::picture(&e, &d);
    let m = metrics(&f, &l.led);
    println!("{m:?}");
    let covered: Vec<usize> = (0..f.covered.len()).filter(|&i| f.covered[i]).collect();
    let mut b: Vec<f64> = covered.iter().map(|&i| l.bound[i] * 255.0).collect();
    b.sort_by(f64::total_cmp);
    let mut r: Vec<f64> = covered.iter().map(|&i| l.error[i] / l.bound[i]).collect();
    r.sort_by(f64::total_cmp);
    for p in [0.01, 0.1, 0.5, 0.9, 0.95, 0.99, 0.999] {
        let i = (p * b.len() as f64) as usize;
        println!("{p}: bound {:.4}/255, ratio {:.4}", b[i], r[i]);
    }
    println!("under 4/255: {:.4}", b.iter().filter(|b| **b < 4.0).count() as f64 / b.len() as f64);
}
