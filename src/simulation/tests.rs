mod flight;
mod images;
mod logs;
mod planting;
mod prescribed;
mod synthetic;
mod tracking;
mod uneven;
