//! Sequence: runs all frames of a scene.

use super::{CheckFlag, RunArgs};
use crate::cli::arguments::SearchedMachine;
use crate::error::{Error, Result};
use crate::hardware::fixed;
use crate::output::files::{Folder, are_one};
use crate::output::progress::Progress;
use crate::output::text::{one_line, wrapped};
use crate::output::video::Video;
use crate::run::against::Photographs;
use crate::run::sequence::{self, Output};
use crate::scene::Sequence;
use rtl_model::Machine;

/// Checked arguments of a run of all frames.
pub(in crate::cli) struct SequenceJob {
    sequence: Sequence,
    machine: Machine,
    /// How the scene differs from those that the machine was searched on, as a list and as a
    /// sentence.
    outside: (Option<Vec<String>>, Option<String>),
    /// One per frame.
    photographs: Option<Photographs>,
    load_seconds: f64,
    output: Output,
    /// Keeps the folder locked while it is written.
    open: Option<Folder>,
    quiet: bool,
}

impl RunArgs {
    pub(super) fn check_sequence(
        self,
        mut sequence: Sequence,
        load_seconds: f64,
    ) -> Result<SequenceJob> {
        self.check_of_one_frame(&sequence)?;
        self.y4m.as_deref().map_or(Ok(()), Video::may_be_written)?;
        let SearchedMachine {
            machine,
            mut outside,
            mut warning,
        } = self.common.searched_machine(sequence.scene())?;
        fixed::elaborate(&machine)?;
        sequence::check(&mut sequence, &machine)?;
        // The scene may differ from those of the search at any camera.
        for frame in (0..sequence.cameras().len())
            .filter(|_| outside.is_some())
            .collect::<Vec<_>>()
        {
            let of_frame = self.common.searched_machine(sequence.frame(frame)?)?;
            let fresh = of_frame.outside.into_iter().flatten();
            outside = outside.map(|mut all| {
                fresh.for_each(|what| {
                    if !all.contains(&what) {
                        all.push(what)
                    }
                });
                all
            });
            warning = warning.or(of_frame.warning);
        }
        if let Some((against, out)) = self
            .against
            .as_deref()
            .zip(self.out.as_deref())
            .filter(|(against, out)| are_one(against, out))
        {
            return Err(Error::input(format!(
                "--against {}: is the folder of --out too, whose pictures are replaced frame by frame: --out {} must be another folder",
                against.display(),
                out.display()
            )));
        }
        let photographs = self
            .against
            .as_deref()
            .map(|path| Photographs::open(path, &sequence, None))
            .transpose()?;
        let open = self.out.as_deref().map(Folder::open).transpose()?;
        let output = Output {
            folder: self.out,
            exr: self.exr,
            video: self.y4m,
        };
        Ok(SequenceJob {
            sequence,
            machine,
            outside: (outside, warning),
            photographs,
            load_seconds,
            output,
            open,
            quiet: self.quiet,
        })
    }

    /// Refuses flags that are for one frame.
    fn check_of_one_frame(&self, sequence: &Sequence) -> Result<()> {
        let single_frame_flags = [
            ("--preview", self.preview),
            ("--requests", self.requests),
            ("--record", self.record.is_some()),
            ("--attribute", self.attribute),
            ("--timing", !self.timing.is_empty()),
            ("--what-if", self.answers),
            ("--check", self.check != CheckFlag::Full),
            ("--unit-costs", self.prices.is_some()),
            ("--ranges", self.ranges),
        ];
        match single_frame_flags.into_iter().find(|(_, is_set)| *is_set) {
            Some((flag, _)) => {
                let (name, frames) = (&sequence.scene().name, sequence.cameras().len());
                Err(Error::input(format!(
                    "{flag}: {name} is a sequence of {frames}, and this flag is for one frame: choose it with --frame N"
                )))
            }
            None => Ok(()),
        }
    }
}

impl SequenceJob {
    pub fn run(mut self) -> Result<String> {
        let (outside, warning) = self.outside;
        if let Some(sentence) = &warning {
            crate::cli::warn(sentence);
        }
        let frames = self.sequence.cameras().len();
        let progress = Progress::of_steps(!self.quiet, frames as u64, "frames");
        let photographs = self.photographs.as_ref();
        let mut report = sequence::run(
            &mut self.sequence,
            &self.machine,
            photographs,
            self.load_seconds,
            &self.output,
            &progress,
        )?;
        drop(progress);
        report.machine.outside_of_search = outside;
        let mut end = Vec::new();
        match &self.output.folder {
            Some(folder) => {
                report.write(folder)?;
                let last = sequence::file_name(frames - 1, "ideal", "png");
                let first = sequence::file_name(0, "fixed", "png");
                end.push(format!(
                    "written to {}: report.json, {first} to {last}",
                    one_line(&folder.to_string_lossy())
                ));
            }
            None => end.push("no pictures written: --out DIR writes them and report.json".into()),
        }
        end.extend(
            self.output
                .video
                .as_ref()
                .map(|path| format!("video in {}", one_line(&path.to_string_lossy()))),
        );
        drop(self.open);
        let end: Vec<String> = end.iter().map(|line| wrapped(line)).collect();
        Ok(if self.quiet {
            String::new()
        } else {
            format!("{}\n{}", report.summary(), end.join("\n"))
        })
    }
}
