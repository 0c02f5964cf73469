//! Sums of products with and without wide registers.

use crate::frontend::products::{Pixels, dot, sums_of_products};

#[test]
fn all_places_have_the_sums_of_single_products() {
    let noise = |seed: usize, index: usize| ((index * 7919 + seed * 104_729) % 4093) as i16 - 2046;
    let weights = [1, 2].map(|seed| std::array::from_fn(|index| noise(seed, index)));
    let pixels: Pixels = std::array::from_fn(|index| noise(3, index) / 16);
    let places = [0, 1, 32, 33].map(|offset| weights.each_ref().map(|weights| dot(weights, &pixels[offset..])));
    assert_eq!(sums_of_products([&weights[0], &weights[1]], &pixels), places);
}
