mod derivatives;
mod recovery;
