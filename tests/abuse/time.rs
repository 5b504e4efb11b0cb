//! Stamps that lie, stand still, jump or come in bursts.
