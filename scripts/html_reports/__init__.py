"""Self-contained HTML reports of motions, torques, studies and accuracy, drawn by Plotly (extra `report`)."""
