//! Datagrams, signals and environments that a peer or an operator may bring.
