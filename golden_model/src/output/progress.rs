//! Progress: shows the progress of a long job: a bar on a terminal, otherwise a line every ten
//! seconds.
//!
//! The remaining time is estimated only from the work done so far.

use crate::error::{Error, Result};
use crate::output::text::{duration, thousands};
use indicatif::{ProgressBar, ProgressStyle};
use std::cell::RefCell;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Time between two lines if standard error is not a terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);
/// Time between two updates of a bar.
const TICK_EVERY: Duration = Duration::from_millis(200);

thread_local! {
    static WATCH: RefCell<Option<Arc<Watch>>> = const { RefCell::new(None) };
}

/// Observes a job from another thread, and may stop it.
#[derive(Debug, Default)]
pub struct Watch {
    state: Mutex<Option<Arc<JobState>>>,
    is_stopped: AtomicBool,
}

impl Watch {
    /// Amount done, total if known, and a message about the current step.
    pub fn now(&self) -> (f64, Option<f64>, String) {
        let state = self
            .state
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone();
        let Some(state) = state else {
            return (0.0, None, String::new());
        };
        let total = match state.goal {
            Goal::Steps(total, _) => Some(total as f64),
            Goal::Seconds(_) | Goal::Open => None,
        };
        (
            state.done.load(Ordering::Relaxed) as f64,
            total,
            state.message(),
        )
    }

    /// Requests the job to stop: it does so before it writes its next row.
    pub fn stop(&self) {
        self.is_stopped.store(true, Ordering::Relaxed);
    }
}

/// Runs `work`, a job whose progress is visible in `watch`, on this thread.
pub fn watched_by<T>(watch: &Arc<Watch>, work: impl FnOnce() -> T) -> T {
    let before = WATCH.replace(Some(Arc::clone(watch)));
    let done = work();
    WATCH.set(before);
    done
}

/// Checks that this thread's job was not stopped.
///
/// # Errors
/// [`Error::Job`] if it was stopped.
pub fn check_not_stopped() -> Result<()> {
    let is_stopped = WATCH.with_borrow(|watch| {
        watch
            .as_ref()
            .is_some_and(|watch| watch.is_stopped.load(Ordering::Relaxed))
    });
    if is_stopped {
        Err(Error::job("stopped"))
    } else {
        Ok(())
    }
}

/// Shows a state, and whether the job is over.
type Show = Box<dyn FnMut(&JobState, bool) + Send>;

/// Display of a job under way, until it is dropped.
#[derive(Debug)]
pub struct Progress {
    state: Arc<JobState>,
    ticker: Option<Ticker>,
}

/// Progress of a job.
#[derive(Debug)]
struct JobState {
    start: Instant,
    goal: Goal,
    done: AtomicU64,
    message: Mutex<String>,
}

/// How the end of a job is known.
#[derive(Clone, Copy, Debug)]
enum Goal {
    /// By a number of steps with a name.
    Steps(u64, &'static str),
    /// By an estimate in seconds.
    Seconds(f64),
    /// Unknown; the job sets messages.
    Open,
}

/// Thread that shows the state until the job ends.
#[derive(Debug)]
struct Ticker {
    end: Sender<()>,
    thread: JoinHandle<()>,
}

impl Progress {
    /// Shows steps with a name, such as `points`, if `shown`.
    pub fn of_steps(shown: bool, total: u64, name: &'static str) -> Self {
        Progress::new(shown, Goal::Steps(total, name))
    }

    /// Shows seconds of an estimate.
    pub fn of_seconds(shown: bool, expected: f64) -> Self {
        Progress::new(shown, Goal::Seconds(expected))
    }

    /// Shows messages, for a job without a known end.
    pub fn of_messages(shown: bool) -> Self {
        Progress::new(shown, Goal::Open)
    }

    fn new(shown: bool, goal: Goal) -> Self {
        let state = Arc::new(JobState {
            start: Instant::now(),
            goal,
            done: AtomicU64::new(0),
            message: Mutex::new(String::new()),
        });
        let ticker = shown.then(|| {
            let (every, show): (_, Show) = if std::io::stderr().is_terminal() {
                (TICK_EVERY, bar(goal))
            } else {
                (
                    LINE_EVERY,
                    Box::new(|state, is_over| {
                        if !is_over {
                            eprintln!("{}", state.line())
                        }
                    }),
                )
            };
            Ticker::start(state.clone(), every, show)
        });
        WATCH.with_borrow(|watch| {
            if let Some(watch) = watch {
                *watch.state.lock().unwrap_or_else(PoisonError::into_inner) =
                    Some(Arc::clone(&state));
            }
        });
        Progress { state, ticker }
    }

    /// Counts one finished step.
    pub fn step(&self) {
        self.state.done.fetch_add(1, Ordering::Relaxed);
    }

    /// Prints a line that stays, such as a forecast.
    pub fn note(&self, line: &str) {
        if self.ticker.is_some() {
            eprintln!("{line}");
        }
    }

    /// Sets the message about the current step.
    pub fn set_message(&self, message: String) {
        *self
            .state
            .message
            .lock()
            .unwrap_or_else(PoisonError::into_inner) = message;
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(Ticker { end, thread }) = self.ticker.take() {
            drop(end);
            // The display is not part of the result.
            let _ = thread.join();
        }
    }
}

impl Ticker {
    /// Shows the state periodically, and once more at the end.
    fn start(state: Arc<JobState>, every: Duration, mut show: Show) -> Self {
        let (end, over) = channel();
        let thread = thread::spawn(move || {
            while over.recv_timeout(every) == Err(RecvTimeoutError::Timeout) {
                show(&state, false);
            }
            show(&state, true);
        });
        Ticker { end, thread }
    }
}

impl JobState {
    fn message(&self) -> String {
        self.message
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Part of the job that is done, 0 to 1; none if its end is unknown.
    fn part(&self) -> Option<f64> {
        match self.goal {
            Goal::Steps(total, _) => {
                Some(self.done.load(Ordering::Relaxed) as f64 / total.max(1) as f64)
            }
            // An estimate that was too short never reaches the end.
            Goal::Seconds(expected) => {
                Some((self.start.elapsed().as_secs_f64() / expected).min(0.99))
            }
            Goal::Open => None,
        }
    }

    /// Text for a log.
    fn line(&self) -> String {
        let elapsed = self.start.elapsed().as_secs_f64();
        match self.goal {
            Goal::Steps(total, name) => {
                let done = self.done.load(Ordering::Relaxed);
                let left = elapsed / done as f64 * total.saturating_sub(done) as f64;
                let left = if done == 0 {
                    String::new()
                } else {
                    format!(", about {} left", duration(left))
                };
                format!("{} of {} {name}{left}", thousands(done), thousands(total))
            }
            Goal::Seconds(expected) => {
                format!("{} of about {}", duration(elapsed), duration(expected))
            }
            Goal::Open => format!("{}: {}", duration(elapsed), self.message()),
        }
    }
}

/// A bar, or a spinner if the end is unknown.
fn bar(goal: Goal) -> Show {
    const LENGTH: u64 = 1000;
    let (bar, template) = match goal {
        Goal::Open => (ProgressBar::new_spinner(), "{spinner} {msg}"),
        Goal::Steps(..) | Goal::Seconds(_) => (ProgressBar::new(LENGTH), "{wide_bar} {msg}"),
    };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    Box::new(move |state, is_over| {
        if is_over {
            return bar.finish_and_clear();
        }
        bar.set_message(state.line());
        match state.part() {
            Some(part) => bar.set_position((part * LENGTH as f64) as u64),
            None => bar.tick(),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(goal: Goal, ago: u64) -> JobState {
        let start = Instant::now()
            .checked_sub(Duration::from_secs(ago))
            .unwrap();
        JobState {
            start,
            goal,
            done: AtomicU64::new(0),
            message: Mutex::new("min+1".into()),
        }
    }

    #[test]
    fn a_watch_shows_a_job_and_can_stop_it() {
        let watch = Arc::new(Watch::default());
        assert_eq!(watch.now(), (0.0, None, String::new()));
        watched_by(&watch, || {
            let progress = Progress::of_steps(false, 7, "points");
            progress.step();
            progress.set_message("here".into());
            assert_eq!(watch.now(), (1.0, Some(7.0), "here".into()));
            assert!(check_not_stopped().is_ok());
            watch.stop();
            assert!(check_not_stopped().is_err());
        });
        assert!(
            check_not_stopped().is_ok(),
            "this thread's next job is another"
        );
    }

    #[test]
    fn an_estimate_is_the_remaining_time() {
        let sweep = state(Goal::Steps(1200, "points"), 60);
        assert_eq!(sweep.line(), "0 of 1,200 points");
        sweep.done.store(300, Ordering::Relaxed);
        assert_eq!(sweep.line(), "300 of 1,200 points, about 3 minutes left");
        assert_eq!(
            state(Goal::Seconds(120.0), 30).line(),
            "30 s of about 2 minutes"
        );
        assert_eq!(state(Goal::Open, 12).line(), "12 s: min+1");
    }

    #[test]
    fn a_job_is_shown_periodically_and_a_short_one_never() {
        let lines = |every: u64, lasts: u64| {
            let shown = Arc::new(Mutex::new(Vec::new()));
            let sink = shown.clone();
            let show = Box::new(move |state: &JobState, is_over: bool| {
                if !is_over {
                    sink.lock().unwrap().push(state.line())
                }
            });
            let ticker = Ticker::start(
                Arc::new(state(Goal::Open, 0)),
                Duration::from_millis(every),
                show,
            );
            thread::sleep(Duration::from_millis(lasts));
            drop(Progress {
                state: Arc::new(state(Goal::Open, 0)),
                ticker: Some(ticker),
            });
            shown.lock().unwrap().len()
        };
        assert!(lines(5, 500) >= 3);
        assert_eq!(lines(60_000, 1), 0);
    }
}
