"""From packets to a stimulus: who may speak, what is believed, how it fades."""
