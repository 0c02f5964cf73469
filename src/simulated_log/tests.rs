mod flight;
mod images;
mod logs;
mod planting;
mod prescribed;
mod tracking;
mod uneven;
