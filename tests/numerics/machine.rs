//! The same numbers whatever the processor can do, and however it treats denormals.
#![allow(unsafe_code, reason = "MXCSR is set and put back")]

use tress::hair::HairModel;
use tress::occlusion::{Receiver, Span};
use tress::selftest::estimators::{Way, Ways};
use tress::selftest::{hard, machine};

use crate::all_hold;

#[test]
fn all_instruction_sets_give_the_same_bits() {
    all_hold(&machine::instructions().expect("Embree"));
}

/// Does work with flush-to-zero and denormals-are-zero on this thread.
#[cfg(target_arch = "x86_64")]
fn flushing<T>(work: impl FnOnce() -> T) -> T {
    const FTZ_AND_DAZ: u32 = 0x8040;
    let mut mode = 0_u32;
    // SAFETY: stores MXCSR in a word of the stack, then loads it with two mode bits more that mask no exception and are valid on every
    // processor with DAZ, which all of x86-64 have; the old value is put back before the work's result is used.
    unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut mode, options(nostack)) };
    let with = mode | FTZ_AND_DAZ;
    // SAFETY: as above.
    unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const with, options(nostack, readonly)) };
    // What is kept from being moved across the change of mode.
    let done = std::hint::black_box(work());
    // SAFETY: as above.
    unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const mode, options(nostack, readonly)) };
    done
}

/// Γ̄ of every face by each way, on this thread.
#[cfg(target_arch = "x86_64")]
fn faces(model: &HairModel, receivers: &[Receiver]) -> Vec<f32> {
    let ways = Ways::new(model).expect("Embree");
    let of = |(way, receiver): (Way, &Receiver)| ways.faces(way, receiver, Span::Sphere, None);
    receivers.iter().flat_map(|receiver| Way::ALL.map(|way| (way, receiver))).flat_map(of).collect()
}

#[test]
#[cfg(target_arch = "x86_64")]
fn flushing_denormals_changes_nothing_that_is_seen() {
    assert_eq!(flushing(|| std::hint::black_box(1e-30_f32) * std::hint::black_box(1e-10_f32)), 0.0, "flushing is on");
    assert!(std::hint::black_box(1e-30_f32) * std::hint::black_box(1e-10_f32) > 0.0, "flushing is off again");
    for hard in hard::all() {
        let usual = faces(&hard.model, &hard.receivers);
        let flushed = flushing(|| faces(&hard.model, &hard.receivers));
        // What is flushed is below 1.2e-38 of a depth; Γ of either differs by less than its last digit but where a comparison with
        // zero turns on it: a lane without opacity or a crossing at a distance of 0.
        let largest = usual.iter().zip(&flushed).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        println!("{}: {largest:e} with denormals flushed", hard.name);
        assert!(flushed.iter().all(|g| g.is_finite()), "{}: not finite", hard.name);
        assert!(largest <= f32::EPSILON, "{}: {largest:e}", hard.name);
    }
}
