//! Images, recordings and files that ask for more memory or time than they are worth.
