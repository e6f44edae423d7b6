//! stub
#[derive(Clone, Copy, Debug)]
pub struct Sums<R> {
    pub weight: R,
    pub rgb: [R; 3],
    pub opacity: R,
    pub normal: [R; 3],
    pub material: u32,
}
#[derive(Clone, Debug)]
pub struct Lighting<R> {
    pub tau: R,
}
