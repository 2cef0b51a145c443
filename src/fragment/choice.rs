//! Drawing a few of many things that are to be shaded, so that each counts in the mean what it weighs.

/// Takes `count` (at least one) of `all` things, or as many as weigh anything: `take` gets the number of each, in order, and the weight that it stands
/// for. Over many `random` in [0, 1) its mean is the thing's own `weight`; together they always stand for the weight of all.
///
/// Things above a bound c keep their weight; one of the others is drawn with the chance weight / c and stands for c, where c is such that there are
/// `count` of them: of all unbiased ways it is that of least variance (Fearnhead and Clifford 2003, "On-line inference for hidden Markov models via particle
/// filters"). They are drawn in equal steps of weight, from the first thing to the last.
pub fn draw(all: usize, weight: impl Fn(usize) -> f64, count: usize, random: f64, mut take: impl FnMut(usize, f64)) {
    let heavy = || (0..all).filter(|&n| weight(n) > 0.0);
    let Bound { bound, drawn } = Bound::new(|| heavy().map(&weight), count.max(1));
    let (mut sum, mut next) = (0.0, 0);
    for n in heavy() {
        let own = weight(n);
        if own >= bound {
            take(n, own);
            continue;
        }
        sum += own;
        if next < drawn && sum > (next as f64 + random) * bound {
            take(n, bound);
            next += 1;
        }
    }
    // By rounding the last step may end behind the last thing.
    if let Some(last) = heavy().rfind(|&n| weight(n) < bound).filter(|_| next < drawn) {
        take(last, bound);
    }
}

/// Weight from which on a thing is taken in any case, and how many of the others are drawn.
struct Bound {
    bound: f64,
    drawn: usize,
}

impl Bound {
    /// For `count` of things of these weights.
    fn new<I: Iterator<Item = f64>>(weights: impl Fn() -> I, count: usize) -> Self {
        if weights().count() <= count {
            return Self { bound: 0.0, drawn: 0 };
        }
        let mut bound = f64::INFINITY;
        let mut kept = 0;
        loop {
            let rest: f64 = weights().filter(|&weight| weight < bound).sum();
            bound = rest / (count - kept) as f64;
            let above = weights().filter(|&weight| weight >= bound).count();
            // Taking out what is above lowers the mean of the others, so there are never more than `count` but for rounding.
            if above == kept || above >= count {
                return Self { bound, drawn: count.saturating_sub(above) };
            }
            kept = above;
        }
    }
}
