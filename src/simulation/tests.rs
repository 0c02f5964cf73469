mod flight;
mod images;
mod logs;
mod synthetic;
mod tracking;
