mod flight;
mod images;
mod logs;
mod prescribed;
mod synthetic;
mod tracking;
mod uneven;
