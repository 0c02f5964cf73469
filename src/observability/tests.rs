mod elimination;
mod golden;
mod scenarios;
mod window;
