//! Fast LSTM sequences of mixed lengths on the CPU, forward and backward.
