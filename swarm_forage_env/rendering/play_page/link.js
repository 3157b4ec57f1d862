// What is asked of the command that made this page. Addresses are relative, so they begin with its token.

const link = {
  /** Send JSON and return what comes back; throws what is to be told to people. */
  async ask(place, words) {
    let answer;
    try {
      answer = await fetch(place, {
        method: "POST",
        headers: { "Content-Type": "application/json" },
        body: JSON.stringify(words),
      });
    } catch {
      throw new LostError("The command has ended. Start it again, and open the address that it shows.");
    }
    const told = await answer.json();
    if (!answer.ok) throw new Error(told.error);
    return told;
  },
};

class LostError extends Error {}
