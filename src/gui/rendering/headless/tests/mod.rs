mod pdf;
mod raster;
mod svg;
