// The arena, in which walls can be drawn: a drag makes one, a click on one removes it.

class PlayPanel extends Panel {
  place_m(event) {
    return this.view.metres(...this.place(event));
  }

  press(event) {
    if (!this.page.drawsWalls) {
      super.press(event);
    } else if (event.button <= 0) {
      this.from = this.to = this.place_m(event);
      this.canvas.setPointerCapture(event.pointerId);
    }
  }

  move(event) {
    if (!this.from) {
      super.move(event);
      return;
    }
    this.to = this.place_m(event);
    this.page.repaint();
  }

  release(event) {
    if (!this.from) {
      super.release(event);
      return;
    }
    const box = [...this.from, ...this.to];
    this.from = null;
    this.page.repaint();
    if (event.type === "pointercancel") return;
    const length = Math.hypot(box[2] - box[0], box[3] - box[1]) * this.view.scale;
    if (length > TAP_PX) this.page.tell({ do: "wall", box });
    else this.page.removeWallAt(box[0], box[1]);
  }

  paint(speed) {
    super.paint(speed);
    this.canvas.classList.toggle("drawing", this.page.drawsWalls);
    if (!this.from) return;
    const [x, y] = [0, 1].map((axis) => [this.from[axis], this.to[axis]].sort((a, b) => a - b));
    this.pen.strokeStyle = theme.colours.text;
    this.pen.lineWidth = 1.5;
    this.painter.fillBox(this.pen, [x[0], y[0], x[1], y[1]], theme.colours.wall, 0.8);
    this.pen.beginPath();
    this.painter.box(this.pen, [x[0], y[0], x[1], y[1]]);
    this.pen.stroke();
  }
}
