use nalgebra::Vector3;

/// Mean of vectors; zero without vectors.
pub fn mean(vectors: &[Vector3<f64>]) -> Vector3<f64> {
    let sum: Vector3<f64> = vectors.iter().sum();
    if vectors.is_empty() { sum } else { sum / vectors.len() as f64 }
}

/// Standard deviation of each component; zero without vectors.
pub fn standard_deviation(vectors: &[Vector3<f64>]) -> Vector3<f64> {
    let centre = mean(vectors);
    let squares: Vec<Vector3<f64>> =
        vectors.iter().map(|vector| (vector - centre).map(|entry| entry * entry)).collect();
    mean(&squares).map(f64::sqrt)
}
