mod flight;
mod synthetic;
