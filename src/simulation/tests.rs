mod flight;
mod logs;
mod pictures;
mod synthetic;
