//! Marks and changed parameters faster than they can be obeyed, and ways out of everything.
