//! Tables, trajectories and pictures without a window.
